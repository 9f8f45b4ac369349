"""Evidence of alarms: what was known when one was raised, kept, shown and printed."""
