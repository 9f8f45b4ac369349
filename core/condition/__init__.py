"""Under which condition a machine runs: its operating state, and the cell that a film is in."""
