"""Experiments: where robots are laid down, disturbed, played and judged."""
