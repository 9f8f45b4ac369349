"""Simulated generating unit: 10-DOF rotor, films, excitation, transducers and converter."""
