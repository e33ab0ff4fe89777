"""What a person looks at afterwards: reports, film strips, plots, replays."""
