"""Chains of resting postures that lead from a fall to a stand, found in physics."""
