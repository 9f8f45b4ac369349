"""Operating condition of a machine: operating state, shaft position and the cell of each film."""
