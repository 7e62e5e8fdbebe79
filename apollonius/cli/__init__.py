"""The command line: commands by purpose, which parse, call and print."""
