"""Authentication and authorisation between the HTTP server and the routes."""
