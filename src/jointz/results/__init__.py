"""Result types: values, tables, text, figures and their files."""
