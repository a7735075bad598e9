"""A page whose pad is a sensor: what touches it in a browser becomes the frames of a simulated textile, sent as OSC."""
