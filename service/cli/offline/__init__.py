"""Work of commands that need no running service: back-test, re-analysis, validation, imports."""
