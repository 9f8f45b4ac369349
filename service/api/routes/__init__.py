"""Routes of the API; each module contains the models and routes of one subject."""
