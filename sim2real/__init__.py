"""Learning: the training environment, training, the pose prior, motions from policies."""
