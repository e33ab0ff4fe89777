"""Keys from elsewhere: action files, animations and tables of other programs."""
