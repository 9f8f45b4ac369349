"""The plant file: models with meaning, unit and limits of every key, and reading of the file."""
