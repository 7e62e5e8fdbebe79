"""Forms that run faster than the plain definition, to the same results; benchmarks pay for each."""
