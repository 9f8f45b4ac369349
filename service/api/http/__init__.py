"""The HTTP server, and its limits on time, size, number, hosts and headers."""
