"""Exit status and last words of a command that is stopped."""

STILL_THERE = "What was recorded is kept; the same arguments with --resume go on."
EXIT_STOPPED = 130
