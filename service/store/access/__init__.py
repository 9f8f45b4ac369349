"""Accounts, sessions, API keys and audit trail entries."""
