"""A simulated plant on the 10-DOF model: excitation, transducers, converter."""
