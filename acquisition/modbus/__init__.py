"""Modbus devices as sample sources."""

import logging

# Whatever pymodbus would log comes back as an exception, and is told once, by who catches it.
logging.getLogger("pymodbus").setLevel(logging.CRITICAL)
