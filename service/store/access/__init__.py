"""Accounts, sessions, keys and entries of the audit trail."""
