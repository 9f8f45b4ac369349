"""The unit as an engineer describes it: bearings, channels, transducers, brackets."""
