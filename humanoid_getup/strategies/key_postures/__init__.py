"""Rises through key postures of a user."""
