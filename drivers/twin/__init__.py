"""The digital twin: one MuJoCo simulation behind the backend protocol."""
