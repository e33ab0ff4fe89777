"""Jobs that get a robot up, or hold it: rise, play a motion, run a policy, sit and hold."""
