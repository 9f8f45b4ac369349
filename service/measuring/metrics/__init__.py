"""What the service tells Prometheus about itself: read when it is asked, counted next to never."""
