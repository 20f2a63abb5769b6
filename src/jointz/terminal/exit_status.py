"""Exit status and last words of a command that is stopped."""

STILL_THERE = "What was recorded is kept; the same arguments with --resume go on."
EXIT_STOPPED = 130
#: Commands that leave something else behind than nothing.
_LEFT_BEHIND = {
    "run": STILL_THERE,
    "console": "The page was not open yet, and no session was begun.",
}
_command = ""


def note_command(name: str | None) -> None:
    """Record the command that was parsed, for the message when it is stopped."""
    global _command
    _command = name or ""


def last_words() -> str:
    """Return what a stop of the parsed command leaves behind, as a sentence."""
    return _LEFT_BEHIND.get(_command, "Nothing half-written was left behind.")
