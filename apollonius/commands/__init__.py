"""One file per command: what it can be told, and what it does. JAX is imported only by those that compute."""
