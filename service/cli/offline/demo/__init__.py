"""The demonstration: simulated units with a past."""
