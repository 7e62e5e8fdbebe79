"""Studies that have no other home yet."""
