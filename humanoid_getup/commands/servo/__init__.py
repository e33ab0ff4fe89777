"""Commands of section servo: set up, read and move single servos on a port."""
