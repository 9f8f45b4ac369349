"""Estimators of film stiffness and damping, their evidence and uncertainty."""
