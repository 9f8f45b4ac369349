"""Settings of sources: measuring devices, simulated machines and imported files."""
