"""Seals: a checksum for each stored row, in a table beside it."""
