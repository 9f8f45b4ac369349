"""Several processes on one plant: JetStream, ownership of units, state through the database."""
