"""What was recorded of a run, and how it ended: standing, lying, torque, impacts."""
