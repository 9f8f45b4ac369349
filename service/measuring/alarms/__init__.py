"""Alarms in the running service: rules from the plant file, the engine that the runner feeds."""
