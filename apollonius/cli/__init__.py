"""The command line: one file a command; each parses, calls and prints. JAX is imported only by those that compute."""
