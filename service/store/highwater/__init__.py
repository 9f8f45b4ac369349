"""The high-water mark: a file beside the database that knows how far the database had come."""
