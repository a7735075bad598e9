"""Hours of everyday life by the other generator, and a model's answers in them."""
