"""The simulated DAQ: any raw feed, served over the real protocol."""
