"""The training environment: vectorized simulation, randomization, rewards."""
