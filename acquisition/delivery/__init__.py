"""What all wires share once their bytes are decoded: blocks, times, freshness."""
