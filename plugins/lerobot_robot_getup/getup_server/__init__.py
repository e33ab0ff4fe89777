"""A robot in a process of its own that follows targets, and gets up after a fall.

It knows nothing of LeRobot, whose import takes longer than all that it does to open a robot.
"""
