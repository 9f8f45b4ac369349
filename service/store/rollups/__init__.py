"""Roll-ups: readings aggregated per minute, ten minutes and hour, by operating condition."""
