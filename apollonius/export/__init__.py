"""JAX functions as programs in C, and players as C or ONNX, checked against the package's own."""
