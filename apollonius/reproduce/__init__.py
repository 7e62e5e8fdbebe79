"""The paper: a function for each figure or table."""
