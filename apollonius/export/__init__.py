"""Players as C, by `jaxpr2c`, or as ONNX, checked against the package's own."""
