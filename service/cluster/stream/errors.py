"""What can go wrong with a stream, sorted by what helps.

::

    StreamError
    └─ StreamMisfitError   stays so until somebody changes servers or settings
    StreamAnewError        another stream than before; what is known of it begins anew
"""


class StreamError(Exception):
    """The servers do not answer, or not as they should; trying later is reasonable."""


class StreamMisfitError(StreamError):
    """Servers, stream and plant file do not fit together; the message says what to do."""


class StreamAnewError(Exception):
    """The stream is another one than before: what is known of it counts no more."""
