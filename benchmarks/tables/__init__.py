"""One module for each table; each runs alone as `python -m benchmarks.tables.NAME`."""
