"""Recordings and tapes: read, written, held against the contract, and played."""
