"""A virtual robot in real time: devices and wire in a process of their own, physics in another.

A reply waits neither for physics nor for a program that computes. On the side of the physics,
`real_time_robot` starts the other process and keeps physics at the clock; it drives the
`remote_devices`. On the side of the wire, `wire_server` serves the `mirrored_robot`. Both publish
their newest values as `shared_rows`; rarely, one calls a method of the other.
"""
