"""Training: PPO, checkpoints, export to ONNX."""

import os

# Beside other work, idle threads of torch that spin would take the processors from the busy ones:
# updates took three to six times as long. OpenMP reads this when torch is imported.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
