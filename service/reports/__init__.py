"""Evidence of alarms: collection during operation, storage in bundles, and reports."""
