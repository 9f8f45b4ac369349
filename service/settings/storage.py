"""Settings of stored data: database, retention, recordings, evidence, spectra, disk space."""

from enum import StrEnum
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from core.limits import Limits
from service.settings.base import Identifier, MisfitError, SecretMisfitError, Settings, Share
from service.settings.processes import FilePath

Conninfo = Annotated[str, StringConstraints(min_length=1, max_length=4096)]


class StoreSettings(Settings):
    """Settings of the results database; by default a SQLite file in the data folder."""

    postgresql: Conninfo | None = None
    """PostgreSQL database instead of SQLite, as libpq keywords or URI without a password; example:
    "host=db.plant.example dbname=padwatch user=padwatch sslmode=verify-full"."""

    password_file: FilePath | None = None
    """File that contains only the password of the PostgreSQL role, readable only by padwatch's user
    (chmod 600); example: "/etc/padwatch/postgresql.password". By default libpq reads
    `~/.pgpass`."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.postgresql is None:
            if self.password_file is not None:
                raise MisfitError("applies only with postgresql; remove it", "password_file")
            return self
        keywords = _keywords(self.postgresql)
        if "password" in keywords or "sslpassword" in keywords:
            raise SecretMisfitError(
                "must not contain a password; write it to a file and set password_file",
                "postgresql",
            )
        if "passfile" in keywords and self.password_file is not None:
            words = "must not be given with passfile in postgresql; remove one of them"
            raise MisfitError(words, "password_file")
        return self

    @property
    def password_path(self) -> Path | None:
        """Path of the password file; None if not set."""
        return None if self.password_file is None else Path(self.password_file)


def _keywords(conninfo: str) -> dict[str, Any]:
    from psycopg import ProgrammingError  # imported late: SQLite does not need it
    from psycopg.conninfo import conninfo_to_dict

    try:
        return conninfo_to_dict(conninfo)
    except ProgrammingError:  # the message of the error may contain the password
        raise SecretMisfitError(
            'is not a libpq connection string such as "host=db.plant.example dbname=padwatch"',
            "postgresql",
        ) from None


Days = Annotated[float, Field(ge=0.0, le=36_500.0)]


class RetentionSettings(Settings):
    """Settings of the retention of results, in days; 0 keeps them without limit.

    Older results are kept only as coarser roll-ups.
    One bearing takes 3 GB a year as single results, and as roll-ups 2.2 GB (minutes), 0.25 GB (ten
    minutes) and 0.05 GB (hours), at the default refresh of 12 s. Never removed: hourly roll-ups
    with minimum, maximum, mean, count and worst quality; alarms and their history; baselines,
    references and the audit trail.
    """

    readings_days: Days = 400.0
    """Retention of single results of bearings; the default of 13 months allows comparing
    seasons."""

    minutes_days: Days = 400.0
    """Retention of one-minute roll-ups; not below readings_days."""

    ten_minutes_days: Days = 3660.0
    """Retention of ten-minute roll-ups; not below minutes_days."""

    films_days: Days = 0.0
    """Retention of film readings, from which baselines are learned; 0.8 GB a year for each
    bearing."""

    messages_days: Days = 400.0
    """Retention of delivered, rejected and expired notifications. Waiting notifications, and the
    last notification of each alarm, are kept."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for finer, coarser in pairwise(("readings_days", "minutes_days", "ten_minutes_days")):
            least, found = getattr(self, finer), getattr(self, coarser)
            if (found and not least) or 0.0 < found < least:
                limit = f"0, like {finer}" if not least else f"0, or at least {finer} = {least:g}"
                raise MisfitError(f"must be {limit}", coarser)
        return self


class RecordingSettings(Settings):
    """Settings of the continuous recording of all samples."""

    samples: Literal["kept", "not_kept"] = "not_kept"
    """Whether all samples are "kept" or "not_kept"; captures around alarms do not depend on this
    key, see [capture]."""

    units: Annotated[tuple[Identifier, ...], Field(max_length=200)] = ()
    """Ids of the units to record; all units if empty. Example: ["U1", "U3"]."""

    folder: Annotated[str, StringConstraints(min_length=1)] | None = None
    """Folder of the recordings, relative to the working directory; "recordings" in the data folder
    by default. A separate disk is recommended; example: "/srv/padwatch/recordings"."""

    length_min: Annotated[int, Field(ge=1, le=60)] = 10
    """Length of each recording, minutes; recordings begin at full multiples of this length, UTC."""

    sync_s: Annotated[float, Field(ge=1.0, le=60.0)] = 30.0
    """Interval of syncs to the disk, s. A power cut loses at most the samples of this interval,
    plus up to 20 s of samples that wait for a slow disk."""

    max_gb: Annotated[float, Field(gt=0.0, le=1_000_000.0)] = 100.0
    """Maximum total size of the recordings, GB (10^9 bytes); above it the oldest recordings are
    removed. Twelve channels at 600 Hz take about half a GB a day."""

    max_days: Annotated[float, Field(gt=0.0, le=36_500.0)] = 30.0
    """Age above which recordings are removed, days. The limit applies only if a unit has one
    day of recordings, so that a wrong clock does not remove all recordings."""

    def keeps(self, unit: str) -> bool:
        """Return whether all samples of a unit are recorded."""
        return self.samples == "kept" and (not self.units or unit in self.units)


class EvidenceSettings(Settings):
    """Settings of alarm evidence: files with the state of the plant at the time of an alarm."""

    max_gb: Annotated[float, Field(gt=0.0, le=10_000.0)] = 2.0
    """Total size of all evidence, GB (10^9 bytes), above which the oldest evidence is removed if it
    is older than keep_days."""

    hard_max_gb: Annotated[float, Field(gt=0.0, le=10_000.0)] = 4.0
    """Total size of all evidence, GB, above which the oldest evidence is removed at any age; must
    not be below max_gb."""

    keep_days: Annotated[float, Field(ge=0.0, le=36_500.0)] = 30.0
    """Age up to which evidence is kept while the total size is below hard_max_gb, days."""

    max_per_alarm: Annotated[int, Field(ge=1, le=100_000)] = 200
    """Maximum number of occurrences of one alarm for which evidence is kept; limits the evidence of
    a chattering alarm."""

    trend_days: Annotated[float, Field(ge=0.1, le=366.0)] = 14.0
    """Length of the film trend in the evidence of an alarm, days."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.hard_max_gb < self.max_gb:
            raise MisfitError(f"must not be below max_gb = {self.max_gb:g}", "hard_max_gb")
        return self


EveryS = Annotated[float, Field(ge=1.0, le=86_400.0)]
Count = Annotated[int, Field(ge=1, le=1_000_000)]


class SpectraSettings(Settings):
    """Settings of stored spectra: recent ones at short intervals, older ones at long intervals.

    A spectrum up to 25 Hz at the default settings takes 4 kB of disk space.
    """

    dense_every_s: EveryS = 60.0
    """Interval between recent (dense) spectra, s."""

    n_dense: Count = 1440
    """Number of dense spectra stored for each bearing; 1440 at 60 s are one day."""

    sparse_every_s: EveryS = 600.0
    """Interval between older (sparse) spectra, s; at least dense_every_s."""

    n_sparse: Count = 52_560
    """Number of sparse spectra stored for each bearing; 52560 at 600 s are one year and take 0.2
    GB."""

    n_lines: Annotated[int, Field(ge=8, le=20_000)] = 1000
    """Maximum number of stored lines of a spectrum, counted from the lowest frequency."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.sparse_every_s < self.dense_every_s:
            limit = f"must not be below dense_every_s = {self.dense_every_s:g}"
            raise MisfitError(limit, "sparse_every_s")
        return self


Gigabytes = Annotated[float, Field(gt=0.0, le=1_000_000.0)]


class SpaceSettings(Settings):
    """Limits of free disk space below which the alarm disk_nearly_full is raised.

    Of the two limits, as a share of the disk and in GB, the limit that is reached first applies.
    """

    alert_free_share: Share = 0.1
    """Free share of a disk below which the alarm is an alert."""

    danger_free_share: Share = 0.05
    """Free share of a disk below which the alarm is a danger; must be below alert_free_share."""

    alert_free_gb: Gigabytes = 2.0
    """Free space, GB (10^9 bytes), below which the alarm is an alert; limited to a quarter of the
    size of the disk."""

    danger_free_gb: Gigabytes = 1.0
    """Free space, GB, below which the alarm is a danger; limited to an eighth of the size of the
    disk. Must be below alert_free_gb."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for unit in ("share", "gb"):
            alert, danger = (getattr(self, f"{level}_free_{unit}") for level in ("alert", "danger"))
            if not danger < alert:
                limit = f"must be below alert_free_{unit} = {alert:g}"
                raise MisfitError(limit, f"danger_free_{unit}")
        return self

    def limits(self, total_bytes: int) -> Limits:
        """Return the limits of the free share of a disk with the capacity `total_bytes`."""
        total_gb = max(total_bytes, 1) / BYTES_PER_GB
        alert = max(self.alert_free_share, min(self.alert_free_gb / total_gb, MAX_ALERT))
        danger = max(self.danger_free_share, min(self.danger_free_gb / total_gb, MAX_DANGER))
        return Limits(alert_below=alert, danger_below=danger, deadband=DEADBAND_SHARE * danger)


MAX_ALERT, MAX_DANGER = 0.25, 0.125
"""Shares of the capacity to which the limits in GB are reduced on small disks."""

DEADBAND_SHARE = 0.2
"""Deadband (hysteresis) of the limits as a share of the danger limit."""

BYTES_PER_GB = 1e9


class Origin(StrEnum):
    """Origin of samples: live plant or replayed recording; the two never share a database."""

    LIVE = "live"
    REPLAY = "replay"
