"""Simulation: a robot compiled into a scene, vectorized physics, clearance, standing places."""
