"""Import of keys: action files, animations and tables of other programs."""
