"""Support of long work: progress, cancellation, resuming, worker processes."""
