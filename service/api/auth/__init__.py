"""Authentication of callers and authorisation of their requests."""
