"""Where results are kept."""

from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import StringConstraints, model_validator

from service.settings.access import FilePath
from service.settings.base import MisfitError, SecretMisfitError, Settings

Conninfo = Annotated[str, StringConstraints(min_length=1, max_length=4096)]


class StoreSettings(Settings):
    """Database of results. Without anything here it is a SQLite file in the data folder."""

    postgresql: Conninfo | None = None
    """A PostgreSQL database instead, as libpq's keywords or URI, never with a password; example:
    "host=db.plant.example dbname=padwatch user=padwatch sslmode=verify-full"."""

    password_file: FilePath | None = None
    """File that holds the password of the PostgreSQL role and nothing else, for padwatch's user
    alone (chmod 600); example: "/etc/padwatch/postgresql.password". Without it `~/.pgpass` is
    asked, if a password is needed."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.postgresql is None:
            if self.password_file is not None:
                raise MisfitError("is for postgresql, which is not given", "password_file")
            return self
        keywords = _keywords(self.postgresql)
        if "password" in keywords or "sslpassword" in keywords:
            raise SecretMisfitError(
                "must not hold a password: put it into a file and name that as password_file",
                "postgresql",
            )
        if "passfile" in keywords and self.password_file is not None:
            raise MisfitError("is given as well as passfile in postgresql", "password_file")
        return self

    @property
    def password_path(self) -> Path | None:
        """The file with the password, if there is one."""
        return None if self.password_file is None else Path(self.password_file)


def _keywords(conninfo: str) -> dict[str, Any]:
    from psycopg import ProgrammingError  # only here: whoever has a file need not wait for it
    from psycopg.conninfo import conninfo_to_dict

    try:
        return conninfo_to_dict(conninfo)
    except ProgrammingError:  # whose message may show a password
        raise SecretMisfitError(
            'is no connection string of libpq, such as "host=db.plant.example dbname=padwatch"',
            "postgresql",
        ) from None
