"""Files: writing, reading, and checks of their content."""
