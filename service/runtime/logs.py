"""Logging: changes of state, one line each, to standard error."""

import sys

import structlog


def set_up_logging() -> None:
    """Coloured lines on a terminal, plain JSON lines for a supervisor."""
    on_terminal = sys.stderr.isatty()
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.dev.ConsoleRenderer() if on_terminal else structlog.processors.JSONRenderer(),
        ],
        logger_factory=structlog.PrintLoggerFactory(sys.stderr),
    )
