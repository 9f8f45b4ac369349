"""Stored data: database, retention, recordings, evidence, disk limits, origin."""

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from service.settings.base import Identifier, MisfitError, SecretMisfitError, Settings
from service.settings.processes import FilePath

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


Days = Annotated[float, Field(ge=0.0, le=36_500.0)]
FINER = (
    ("readings_days", "minutes_days"),
    ("minutes_days", "ten_minutes_days"),
)


class RetentionSettings(Settings):
    """Ages beyond which results are kept coarser only, in days; 0 keeps them for ever.

    One bearing takes 3 GB a year as single results, 2.2 GB as minutes, 0.25 GB as ten minutes and
    0.05 GB as hours, at the default refresh of 12 s. Kept for ever: hours with minimum, maximum,
    mean, count and worst quality; alarms and their history; baselines, references, the audit trail.
    """

    readings_days: Days = 400.0
    """Single results of bearings: a year and a month, so that every season has its counterpart."""

    minutes_days: Days = 400.0
    """Results by the minute; not below readings_days."""

    ten_minutes_days: Days = 3660.0
    """Results by ten minutes; not below minutes_days."""

    films_days: Days = 0.0
    """Readings of films, which baselines are learned from, 0.8 GB a year for each bearing."""

    messages_days: Days = 400.0
    """Messages to receivers that were delivered, refused or given up. What waits, waits; of each
    alarm the last one is kept."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for finer, coarser in FINER:
            least, found = getattr(self, finer), getattr(self, coarser)
            if (found and not least) or 0.0 < found < least:
                limit = "0" if not least else f"at least {finer}, {least:g}, or 0"
                raise MisfitError(f"must be {limit}", coarser)
        return self


class RecordingSettings(Settings):
    """All samples of units, kept one after the other as recordings."""

    samples: Literal["kept", "not_kept"] = "not_kept"
    """Whether all samples are "kept" or "not_kept"; those around alarms are kept in either case,
    see [capture]."""

    units: Annotated[tuple[Identifier, ...], Field(max_length=200)] = ()
    """Only of these units; empty for all. Example: ["U1", "U3"]."""

    folder: Annotated[str, StringConstraints(min_length=1)] | None = None
    """Where they are kept, relative to where padwatch is started; without it "recordings" in the
    data folder. Best on a disk of its own; example: "/srv/padwatch/recordings"."""

    length_min: Annotated[int, Field(ge=1, le=60)] = 10
    """Length of each recording, minutes; a new one begins at every full multiple of it, UTC."""

    sync_s: Annotated[float, Field(ge=1.0, le=60.0)] = 30.0
    """How often what was recorded is brought to the disk, s: a power cut costs no more than this
    and what a slow disk has let wait, at most 20 s."""

    max_gb: Annotated[float, Field(gt=0.0, le=1_000_000.0)] = 100.0
    """Space of all of them together, GB (10^9 bytes); beyond it the oldest are removed. Twelve
    channels at 600 Hz take about half a GB a day."""

    max_days: Annotated[float, Field(gt=0.0, le=36_500.0)] = 30.0
    """Those are removed that are older than this, days, counted from the moment that a day of
    recordings of the unit lies behind: no clock makes anything old before."""

    def require_units(self, units: Sequence[str]) -> None:
        """Refuse a unit that the plant does not have.

        Raises
        ------
        MisfitError
            If there is one.
        """
        for n, unit in enumerate(self.units):
            if unit not in units:
                words = f"is no unit of this plant, it has {', '.join(units)}"
                raise MisfitError(words, "recording", "units", n)

    def keeps(self, unit: str) -> bool:
        """Whether all samples of a unit are kept."""
        return self.samples == "kept" and (not self.units or unit in self.units)


class EvidenceSettings(Settings):
    """Evidence of alarms, in the data folder: what was known when one was raised."""

    max_gb: Annotated[float, Field(gt=0.0, le=10_000.0)] = 2.0
    """Space of all of it together, GB (10^9 bytes); beyond it the oldest is removed that is older
    than keep_days."""

    hard_max_gb: Annotated[float, Field(gt=0.0, le=10_000.0)] = 4.0
    """Beyond this the oldest is removed however young it is, GB; must not be below max_gb."""

    keep_days: Annotated[float, Field(ge=0.0, le=36_500.0)] = 30.0
    """Younger evidence stays as long as there is room below hard_max_gb, days."""

    max_per_alarm: Annotated[int, Field(ge=1, le=100_000)] = 200
    """Occurrences that are kept of one alarm, so that one that chatters pushes out no other."""

    trend_days: Annotated[float, Field(ge=0.1, le=366.0)] = 14.0
    """How long before an alarm the readings of its film are kept with it, days."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.hard_max_gb < self.max_gb:
            raise MisfitError(f"must not be below max_gb, {self.max_gb:g}", "hard_max_gb")
        return self


Share = Annotated[float, Field(gt=0.0, lt=1.0)]
Gigabytes = Annotated[float, Field(gt=0.0, le=1_000_000.0)]


class SpaceSettings(Settings):
    """Free room on the disks of the data folder, below which the alarm disk_nearly_full is raised.

    What is reached first counts: the share of the disk, or the gigabytes.
    """

    alert_free_share: Share = 0.1
    """Free share of a disk below which it is an alert."""

    danger_free_share: Share = 0.05
    """Free share below which it is a danger; must be below alert_free_share."""

    alert_free_gb: Gigabytes = 2.0
    """Free GB (10^9 bytes) below which it is an alert; never more than a quarter of the disk."""

    danger_free_gb: Gigabytes = 1.0
    """Free GB below which it is a danger, at most an eighth of the disk; must be below
    alert_free_gb."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for unit in ("share", "gb"):
            alert, danger = (
                getattr(self, f"alert_free_{unit}"),
                getattr(self, f"danger_free_{unit}"),
            )
            if not danger < alert:
                limit = f"must be below alert_free_{unit}, {alert:g}"
                raise MisfitError(limit, f"danger_free_{unit}")
        return self


class Origin(StrEnum):
    """Where samples come from; a replay never shares a database with the live plant."""

    LIVE = "live"
    REPLAY = "replay"
