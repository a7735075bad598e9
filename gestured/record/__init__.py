"""Recordings and tapes: read, written, checked against the contract, and played."""
