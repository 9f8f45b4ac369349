"""Roll-ups of readings over one minute, ten minutes and one hour, by operating condition."""
