"""Learning and calibration of get-up policies."""
