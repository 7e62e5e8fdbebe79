"""Errors, limits, files, arrays by name, one cache, worker processes."""
