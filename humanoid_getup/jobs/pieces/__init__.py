"""Work of jobs that engines do in pieces: a worker makes what it needs from the request alone."""
