"""The dashboard: static pages over the HTTP API, no build step."""
