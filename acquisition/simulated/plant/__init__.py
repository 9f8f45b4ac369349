"""Simulated generating unit: 10-DOF rotor, oil films, excitation, transducers, converter."""
