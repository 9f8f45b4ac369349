"""Builds processes from a plant file and a set of roles, and runs them."""
