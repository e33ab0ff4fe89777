"""Exit codes of every command."""

DID_IT = 0
DID_NOT_STAND = 1
BAD_INPUT = 2
HARDWARE_FAULT = 3
INTERRUPTED = 130
