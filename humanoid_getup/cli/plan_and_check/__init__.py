"""Commands that plan, make and check motions, styles and scenes."""
