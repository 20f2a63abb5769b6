"""Style, words and templates that pages and figures share."""
