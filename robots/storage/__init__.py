"""Files: how they are written and read, and what is checked of their content."""
