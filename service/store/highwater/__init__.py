"""High-water mark, which detects a database that was restored from an older copy."""
