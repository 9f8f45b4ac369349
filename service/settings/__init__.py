"""Plant file: pydantic models that document and validate every key, and the TOML parser."""
