"""Work of commands without a running service: back-test, analysis again, validation, imports."""
