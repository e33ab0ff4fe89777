"""From a path to targets that real servos can follow."""
