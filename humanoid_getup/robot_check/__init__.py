"""Robot check: is a robot's description sound, and is its body able to get up?"""
