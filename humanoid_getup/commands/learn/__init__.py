"""Commands that train policies and evaluate them."""
