"""Clips of motion capture: files of skeletons that move, read as joint positions."""
