"""The pad: a page on which touches in a browser become the frames of a simulated textile, which are sent as OSC."""
