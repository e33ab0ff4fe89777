"""The pose prior: a model of the postures of rises, and the rises that it is fitted to."""
