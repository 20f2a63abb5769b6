"""Argument parsing and printing; each command calls one library function."""
