"""Rises through key postures that a user gives."""
