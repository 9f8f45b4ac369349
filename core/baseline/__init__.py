"""Baselines of film stiffness: expected values under each operating condition, and learning."""
