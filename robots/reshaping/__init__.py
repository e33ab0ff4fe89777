"""Other bodies: the same robot with other lengths, masses and inertias."""
