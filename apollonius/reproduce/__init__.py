"""The paper's evaluation: each figure or table a function from a study to a finding."""
