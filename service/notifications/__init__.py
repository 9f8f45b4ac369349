"""Notifications about alarms by webhook and mail, through a durable outbox."""
