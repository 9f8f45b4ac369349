"""CAN buses, classic and FD, as sample sources; nothing here ever sends a frame."""

import logging
import sys

# python-can would load asammdf for a log format that is not used here, and with it pandas: a third
# of the time that the service takes to start. Where it is missing, it goes without.
if "asammdf" not in sys.modules:
    sys.modules["asammdf"] = None  # type: ignore[assignment]
    import can  # noqa: F401

    del sys.modules["asammdf"]

# All that python-can would log is raised as well, and logged once where it is caught.
for _name in ("can", "cantools"):
    logging.getLogger(_name).setLevel(logging.CRITICAL)
