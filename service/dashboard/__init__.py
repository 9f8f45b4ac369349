"""Dashboard: static pages that use the HTTP API; they need no build step."""
