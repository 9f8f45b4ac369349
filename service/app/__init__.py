"""Construction and execution of the padwatch processes of a plant file, by role."""
