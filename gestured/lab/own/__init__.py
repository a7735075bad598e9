"""Own gestures: the space in which a model compares examples, learned and judged on simulated people."""
