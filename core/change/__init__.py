"""Detection of a change of film stiffness from its baseline, and of its cause."""
