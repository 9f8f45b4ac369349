"""Database of the plant: results, alarms, films, accounts, audit trail, retention and backup."""
