"""Judging of runs: records, and their outcome: standing, lying, torque, impacts."""
