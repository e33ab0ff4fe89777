"""Strategies to get up: planned, learned, stored; and the choice of one."""
