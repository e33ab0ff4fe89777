"""Commands of robots: their folders, their buses and their servos."""
