"""`getup servo`: single servos on a port."""
