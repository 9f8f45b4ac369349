"""The `padwatch` command."""
