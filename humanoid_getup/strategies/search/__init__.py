"""The search for a planned rise: paths to stored motions, rounds of candidates, crawls."""
