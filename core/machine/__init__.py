"""Description of a generating unit: bearings, channels, transducers, brackets."""
