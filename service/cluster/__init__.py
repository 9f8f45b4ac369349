"""Operation of a plant by several processes: JetStream, ownership of units, shared state."""
