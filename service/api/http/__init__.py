"""The HTTP server's defence: deadlines, sizes, counts, hosts, headers."""
