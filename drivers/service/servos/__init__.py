"""Service of servos without a robot's description: registers, ids, guarded motion."""
