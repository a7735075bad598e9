"""The report: study.json as Markdown with its figures (page.py); the picture of error against run time."""
