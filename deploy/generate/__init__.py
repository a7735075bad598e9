"""What is made from the programs' own words: the example configuration, man pages and shell completions."""
