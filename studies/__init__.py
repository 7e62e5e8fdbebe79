"""Studies beyond the paper, each with several seeds: `python -m studies.held_out --help`."""
