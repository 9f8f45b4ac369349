"""Whether a film has changed, compared with its baseline, and why."""
