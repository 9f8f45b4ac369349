"""Modbus devices as sample sources; nothing here can write."""
