"""Golden traces: what a policy measured, observed, did and caused, and checks against them."""
