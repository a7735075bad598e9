"""A user's own recordings: collected at a terminal, imported, checked, forgotten. Needs numpy alone."""
