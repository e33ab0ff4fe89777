"""Where a robot falls and rises: scenes, compiled worlds, vectorized rollouts, falls."""
