"""Evidence of alarms: collected while measuring, kept in bundles, and shown as reports."""
