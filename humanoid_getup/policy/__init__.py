"""Learned policies: action and observation space, contract, ONNX runner."""
