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
    """Error raised if settings do not match the device or file, for example in channel count."""


class LinkError(AcquisitionError):
    """Error raised if the device does not respond or replies wrongly; retrying may succeed."""


class FrameError(AcquisitionError):
    """Error raised if the device sent an invalid reply or frame."""
