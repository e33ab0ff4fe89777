"""Commands that get a robot up, or hold it: `rise`, `play`, `run`, `sit` and `hold`."""
