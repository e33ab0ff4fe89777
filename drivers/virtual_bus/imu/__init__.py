"""Virtual IMUs: each speaks as its sensor does, and measures a simulated robot."""
