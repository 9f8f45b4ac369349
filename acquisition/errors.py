"""What can go wrong between a plant and padwatch, sorted by what the caller should do.

::

    AcquisitionError
    ├─ ConfigError   can never work     → stop trying this source, tell the operator
    ├─ LinkError     not answering now  → wait, retry
    └─ FrameError    answered nonsense  → drop it, count it
"""


class AcquisitionError(Exception):
    """Base of all errors an adapter lets out."""


class ConfigError(AcquisitionError):
    """The settings and the device can never fit together: wrong magic, version or channel count."""


class LinkError(AcquisitionError):
    """The device does not answer now; trying later is reasonable."""


class FrameError(AcquisitionError):
    """The device answered something that is not an answer to the question."""
