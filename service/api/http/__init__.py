"""HTTP server with limits on the duration, size and number of requests, and host checks."""
