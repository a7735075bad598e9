"""The client side of a running daemon, shared by gesturectl, the bridges and the lab."""
