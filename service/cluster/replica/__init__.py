"""Several processes for one plant: those that analyse write down what those that serve read."""
