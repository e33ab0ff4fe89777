"""Where a robot lies and rises: ground, obstacles, surfaces."""
