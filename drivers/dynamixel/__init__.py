"""The Dynamixel backend: Protocol 2.0 over a serial port, servos and an OpenCR board."""
