"""The report: study.json as a self-contained page and as Markdown (page.py); the picture of error against run time."""
