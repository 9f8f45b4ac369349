"""Copies of the database: made while the service runs, verified, and put back."""
