"""Data between measuring and serving: newest results and samples, alarm list, commands."""
