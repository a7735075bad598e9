"""Recordings of one's own: collected at a terminal, imported, looked at, forgotten. Needs numpy alone."""
