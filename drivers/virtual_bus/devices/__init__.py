"""Virtual devices: servos and a board that answer byte for byte; no clock, no thread."""
