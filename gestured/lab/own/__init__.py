"""Gestures of one's own: what a model needs to compare examples, learned and judged on simulated people."""
