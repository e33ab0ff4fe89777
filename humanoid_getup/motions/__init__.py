"""Rising motions: the type, the database, how they are made and optimized."""
