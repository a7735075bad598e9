"""The report: study.json drawn as one self-contained HTML page (page.py)."""
