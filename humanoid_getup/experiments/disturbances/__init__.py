"""How robots and their worlds differ from those that were planned for."""
