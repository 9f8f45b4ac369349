"""Errors of sample sources, classified by the required action of the caller.

::

    AcquisitionError
    ├─ ConfigError   configuration cannot work  → do not retry; report to the operator
    ├─ LinkError     device does not respond    → wait, retry
    └─ FrameError    invalid frame              → drop and count
"""


class AcquisitionError(Exception):
    """Base class of the errors that adapters raise."""


class ConfigError(AcquisitionError):
    """The settings do not match the device, for example in protocol version or channel count."""


class LinkError(AcquisitionError):
    """The device does not respond; a later attempt may succeed."""


class FrameError(AcquisitionError):
    """The device sent an invalid reply or frame."""
