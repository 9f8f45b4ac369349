"""Modbus devices as sample sources."""
