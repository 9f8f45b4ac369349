"""Files of other tools, each by its library."""
