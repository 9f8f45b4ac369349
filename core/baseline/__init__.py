"""What healthy films are like under each condition, learned from readings and kept as a value."""
