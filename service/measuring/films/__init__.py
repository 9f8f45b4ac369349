"""Films in the running service: what is watched, learned, decided, and done by engineers."""
