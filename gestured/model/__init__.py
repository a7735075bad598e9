"""Model files: looked at, opened, run, and one above the other as a ladder."""
