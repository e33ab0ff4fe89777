"""Where the episodes of a training begin."""
