"""Options of the commands, as dataclasses; nothing here imports anything heavy."""
