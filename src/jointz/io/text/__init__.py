"""Delimited text, workbooks, units and column names."""
