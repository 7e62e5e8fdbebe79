"""The paper's evaluation: one file per figure or table, each a function from a study to a finding."""
