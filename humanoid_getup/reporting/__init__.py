"""Reporting of results: reports, film strips, plots, replays."""
