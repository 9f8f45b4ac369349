"""A process and its machine: loops, heartbeats, files, disks, times, tables."""
