"""The web server of console and explorer."""
