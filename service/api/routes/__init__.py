"""Routes of the API: a file for each subject, with its models and its routes."""
