"""Simulated measuring devices: sample feeds over real Modbus and CAN protocols."""
