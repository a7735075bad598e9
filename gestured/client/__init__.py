"""What talks to a running daemon from outside: shared by gesturectl and the lab."""
