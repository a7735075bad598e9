"""What answers a question once: programs that print tables, beside the package and its tests."""
