"""What all commands share: console, exit codes, and where results go."""
