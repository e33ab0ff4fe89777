"""What describes a robot: its robot.toml, servos and calibration, read and checked."""
