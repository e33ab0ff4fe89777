"""The work of commands as functions: a request in, a result out, progress, cancellation."""
