"""The 10-DOF machine, its excitation, transducers and converter."""
