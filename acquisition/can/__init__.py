"""Sample sources for CAN and CAN FD buses; listen-only, frames are never sent."""

import logging
import sys

# Without this block python-can imports asammdf, for an unused log format, and with it pandas: a
# third of the start time of the service. python-can works without asammdf.
if "asammdf" not in sys.modules:
    sys.modules["asammdf"] = None  # type: ignore[assignment]
    import can  # noqa: F401

    del sys.modules["asammdf"]

# python-can also raises all that it logs; the exception is logged where it is caught.
for _name in ("can", "cantools"):
    logging.getLogger(_name).setLevel(logging.CRITICAL)
