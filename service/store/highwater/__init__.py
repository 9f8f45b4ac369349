"""High-water mark, which reveals that a database was replaced by an older copy."""
