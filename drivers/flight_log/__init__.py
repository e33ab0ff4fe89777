"""Flight logs: a run recorded as MCAP, and read back."""
