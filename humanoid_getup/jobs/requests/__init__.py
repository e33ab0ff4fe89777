"""Requests of jobs as dataclasses; nothing here imports anything heavy."""
