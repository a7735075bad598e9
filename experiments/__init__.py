"""Experiments: programs that answer one question with a table, outside of the package and its tests."""
