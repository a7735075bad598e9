"""Hours of everyday life on a sensor, and what is said in them."""
