"""CAN buses, classic and FD, as sample sources; nothing here ever sends a frame."""

import logging

# Whatever python-can would log comes back as an exception, and is told once, by who catches it.
for _name in ("can", "cantools"):
    logging.getLogger(_name).setLevel(logging.CRITICAL)
