"""What jobs are asked for, as dataclasses; nothing here imports anything heavy."""
