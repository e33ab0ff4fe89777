"""A virtual robot in real time: devices and wire in a process of their own, physics in another.

An answer never waits for physics, nor for a client that computes. `RealTimeRobot` is the side of
the physics, `wire_server` that of the wire; they share newest values in `SharedMemory`. Physics
that a busy computer keeps from its time falls behind, which is counted.
"""
