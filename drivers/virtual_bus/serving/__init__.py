"""Serves virtual devices on a pseudo-terminal, in real time or in lock-step, with faults."""
