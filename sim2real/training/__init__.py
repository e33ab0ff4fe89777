"""Training: PPO, checkpoints, export to ONNX."""
