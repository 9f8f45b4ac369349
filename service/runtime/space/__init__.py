"""How full the disks are that padwatch writes to, and when they will be."""
