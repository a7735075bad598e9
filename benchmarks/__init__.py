"""What speed costs and is worth, as ratios measured side by side: `make bench`."""
