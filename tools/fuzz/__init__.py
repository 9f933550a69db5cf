"""Fuzzing of every reader; see `tools.fuzz.__main__`."""
