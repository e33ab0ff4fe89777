"""Motion capture: clips of moving bodies as motions of a robot."""
