"""From the folders of `limn compare` and `limn reject` to one HTML page, see tools/report.py."""
