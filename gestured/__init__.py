"""gestured: a real-time tactile gesture recognition daemon."""

__version__ = "0.1.0"
