"""Text and tables for a paper: the methods section and tables in CSV and LaTeX."""
