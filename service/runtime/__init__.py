"""Process services: loops, heartbeats, metrics, files, disk space, time formats, sd_notify."""
