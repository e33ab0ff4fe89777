"""Live feed: what a running program measures and sends, for other programs of the same user."""
