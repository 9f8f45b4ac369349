"""Settings of sample sources: measuring devices, simulated machines and imported files."""
