"""Hardware abstraction: backends, twin, safety guard and control loop."""
