"""Code that all commands share: console, exit codes, output."""
