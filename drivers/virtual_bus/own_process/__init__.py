"""A virtual robot in real time: devices and wire in a process of their own, physics in another.

A reply waits neither for physics nor for a program that computes. Both sides publish their newest
values as `shared_rows`; rarely, one calls a method of the other.
"""
