"""Secrets: read when they are needed, never kept in settings or shown in messages."""

import os
from dataclasses import dataclass
from pathlib import Path

MAX_BYTES = 8192


class SecretError(Exception):
    """A secret cannot be read; the message says from where, never what."""


@dataclass(frozen=True)
class Secret:
    """Where a secret is: a file, or a variable of the environment.

    Parameters
    ----------
    file, env
        One of them.
    """

    file: Path | None = None
    env: str | None = None

    def read(self) -> str:
        """Read it, without the line's end that editors add.

        Raises
        ------
        SecretError
            If there is none, or it is no printable line.
        """
        text = self._text().strip()
        if not text or not text.isprintable():
            raise SecretError(f"{self._place} holds no single line of printable text")
        return text

    @property
    def _place(self) -> str:
        return f"file {self.file}" if self.file is not None else f"environment variable {self.env}"

    def _text(self) -> str:
        if self.file is None:
            return os.environ.get(self.env or "", "")
        try:
            with self.file.open("rb") as file:
                return file.read(MAX_BYTES).decode()
        except OSError as error:
            raise SecretError(f"{self._place}: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise SecretError(f"{self._place} is not UTF-8 text") from error
