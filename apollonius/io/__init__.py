"""What is read and written: errors, limits, files, arrays, one cache, worker processes."""
