"""gesturectl: the operator's client of a running daemon, and the demo."""
