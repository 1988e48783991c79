"""The tasks of a mission, a file for each."""
