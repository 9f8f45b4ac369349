"""Who asks, and whether they may: between the HTTP server and the routes."""
