"""Commands: a request, its work, and what it prints, each in one file."""
