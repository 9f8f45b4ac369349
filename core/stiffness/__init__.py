"""The estimators of film stiffness and damping, their evidence and uncertainty."""
