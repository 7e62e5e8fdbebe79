"""Trained agents as files that need no JAX: ONNX, one NumPy module, C99."""
