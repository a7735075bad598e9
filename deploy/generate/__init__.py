"""The generators of the example configuration, man pages, completions, the dashboard and the animation."""
