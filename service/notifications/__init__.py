"""Delivery: alarms told to webhooks and mailboxes through a durable outbox."""
