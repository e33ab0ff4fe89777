"""What counts as standing, and how a run is judged."""
