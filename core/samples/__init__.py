"""Samples of one unit as they come, exact to the gap."""
