"""Films watched reading by reading: what is measured of each, and what is said of it."""
