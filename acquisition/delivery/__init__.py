"""Shared parts of all adapters after decoding: blocks, time stamps, polling, units."""
