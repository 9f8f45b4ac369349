"""Distribution of a plant over several processes: JetStream, unit locks and reported state."""
