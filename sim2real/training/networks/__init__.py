"""Networks of policies: symmetric ones, the styled one with its decoder, and their extension."""
