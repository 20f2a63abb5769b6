"""Files of a session: journal, log, locks."""
