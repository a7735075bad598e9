"""Benchmarks: figures of speed, each beside a comparison that is measured in turn with it (`make bench`)."""
