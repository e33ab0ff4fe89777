"""From a lying posture to a motion: collision-free search, refinement, smoothing."""
