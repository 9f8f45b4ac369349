"""Accounts, sessions, keys and the audit trail."""
