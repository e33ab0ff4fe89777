"""Long work: reported, cancelled, kept so that it can go on later, spread over processes."""
