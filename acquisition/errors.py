"""Errors of sources, by what the caller should do.

::

    AcquisitionError
    ├─ ConfigError   can never work     → stop trying this source, tell the operator
    ├─ LinkError     not answering now  → wait, retry
    └─ FrameError    a wrong frame      → drop it, count it
"""


class AcquisitionError(Exception):
    """Base class of the errors that adapters raise."""


class ConfigError(AcquisitionError):
    """The settings and the device can never fit together: wrong magic, version or channel count."""


class LinkError(AcquisitionError):
    """The device does not answer now; trying later is reasonable."""


class FrameError(AcquisitionError):
    """The device sent a reply or frame that cannot be right."""
