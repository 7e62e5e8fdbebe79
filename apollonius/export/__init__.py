"""JAX functions as programs that need no JAX: C, JavaScript, ONNX."""
