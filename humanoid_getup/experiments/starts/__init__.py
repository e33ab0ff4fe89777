"""Where robots lie or stand before they are played: sampled falls, drops, settling."""
