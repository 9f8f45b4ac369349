"""Sample blocks of one unit, with an exact account of gaps and restarts."""
