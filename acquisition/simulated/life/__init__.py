"""Years in the life of a unit's guide bearings: as readings, or a moment of them as a scenario."""
