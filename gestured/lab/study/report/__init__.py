"""The report: study.json as one self-contained HTML page and as Markdown (page.py), and the picture of the README."""
