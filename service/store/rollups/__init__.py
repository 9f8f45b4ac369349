"""Trends gathered beforehand: buckets of a minute, ten minutes and an hour, parted by condition."""
