"""What is given up first when the service cannot keep up: questions, never samples or alarms."""
