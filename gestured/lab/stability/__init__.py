"""Numerical stability, measured: filters, extremes, models and the metamorphic properties of the whole path."""
