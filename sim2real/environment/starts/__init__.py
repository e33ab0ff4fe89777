"""Initial states of training episodes."""
