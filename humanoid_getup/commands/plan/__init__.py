"""Commands that plan, and that check what is planned."""
