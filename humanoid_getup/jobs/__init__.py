"""What commands do, as functions: a request in, a result out, with progress and cancellation."""
