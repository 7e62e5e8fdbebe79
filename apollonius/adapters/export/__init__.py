"""Trained agents as files that need no JAX: ONNX and C99."""
