"""Where a robot falls and rises: scenes, compiled worlds, vectorised rollouts, falls."""
