"""Results of a run for people: reports, film strips, plots, replays."""
