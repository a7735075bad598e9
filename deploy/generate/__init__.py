"""Files generated from settings and parsers: the example configuration, man pages, completions; also a dashboard."""
