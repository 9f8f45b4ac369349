"""What breaks disks, processes and links on purpose, and counts what is lost by it."""
