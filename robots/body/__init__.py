"""The body of a robot: its limbs and what they are for, lengths, balance, and overlap."""
