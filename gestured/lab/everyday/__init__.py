"""`gestured-lab everyday`: a model's answers in hours of everyday contact, in which few gestures are meant."""

FIRST = 5000  # the first day's seed; no training has drawn it
