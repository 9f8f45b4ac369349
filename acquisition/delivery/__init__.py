"""Parts that all adapters share: sample blocks, time stamps, polling, units."""
