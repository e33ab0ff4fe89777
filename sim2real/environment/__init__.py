"""The training environment: vectorised simulation, randomization, rewards."""
