"""Libraries for the files of others, loaded when they are needed: an extra of the installation."""

import importlib
from typing import Any

from acquisition.errors import ConfigError


def library(name: str, what: str) -> Any:
    """Import a library that not every installation has.

    Raises
    ------
    ConfigError
        If this one has not.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ConfigError(f"{what} needs {name}: pip install 'padwatch[imports]'") from error
