"""Numerical stability, measured: filters, extreme inputs through the whole path, and models by their answers."""
