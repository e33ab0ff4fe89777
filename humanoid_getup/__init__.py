"""Getting up: motion database, planner, dynamics filter and command line."""
