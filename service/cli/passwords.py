"""Passwords for commands: asked on the terminal or read from a descriptor, never an argument."""

import os
import sys
from typing import Annotated

import typer

from service.cli.plant_file import fail

MAX_BYTES = 4096

PasswordFd = Annotated[
    int | None,
    typer.Option(min=0, help="Read the password from this file descriptor instead of asking."),
]


def password_from(descriptor: int | None, command: str) -> str:
    """Get a new password; ends the command with exit code 2 if there is none to be had."""
    if descriptor is not None:
        return _read(descriptor, command)
    if not sys.stdin.isatty():
        fail(f"{command}: there is no terminal to ask on; use --password-fd", 2)
    asked: str = typer.prompt("Password", hide_input=True, confirmation_prompt=True)
    return asked


def _read(descriptor: int, command: str) -> str:
    found = b""
    try:
        while len(found) <= MAX_BYTES and (more := os.read(descriptor, MAX_BYTES)):
            found += more
    except OSError as error:
        fail(f"{command}: file descriptor {descriptor}: {error.strerror}", 2)
    if len(found) > MAX_BYTES:
        fail(f"{command}: file descriptor {descriptor} holds more than a password", 2)
    try:
        return found.decode().removesuffix("\n").removesuffix("\r")
    except UnicodeDecodeError:
        fail(f"{command}: file descriptor {descriptor} holds no UTF-8 text", 2)
