"""Process services: loops, heartbeats, metrics, files, disk space, times, service manager."""
