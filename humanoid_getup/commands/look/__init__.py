"""Commands that show, replay, export and measure."""
