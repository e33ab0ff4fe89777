"""Training of the pose prior: rises are collected, and an autoencoder is fitted to them."""
