"""Recordings in padwatch's format (manifest and Parquet), and imported files of other tools."""
