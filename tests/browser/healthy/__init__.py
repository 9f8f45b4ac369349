"""Pages of a plant in good health."""
