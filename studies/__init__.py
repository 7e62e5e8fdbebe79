"""Studies beyond the paper, each with several seeds: `python -m studies.schemes --help`."""
