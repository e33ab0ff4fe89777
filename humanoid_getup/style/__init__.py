"""Style: curves of neck height and torso orientation that a rise follows."""
