"""What crosses between measuring and serving: newest results, newest samples, commands."""
