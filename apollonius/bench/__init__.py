"""How fast it is: env steps and updates per second, on the machine at hand."""
