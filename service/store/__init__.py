"""Database of a plant: results, alarms, oil films, accounts, audit trail, retention, backups."""
