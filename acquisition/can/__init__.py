"""CAN and CAN FD devices as sample sources."""
