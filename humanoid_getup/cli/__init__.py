"""The command line, `getup`: one command a file."""
