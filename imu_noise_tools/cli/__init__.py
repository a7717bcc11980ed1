"""The command line: parsing, progress and printing; all else is in tasks."""
