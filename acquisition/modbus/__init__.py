"""Sample sources for Modbus devices; read requests only, registers are never written."""
