"""Operating condition of a machine: operating state, shaft position, condition cells of films."""
