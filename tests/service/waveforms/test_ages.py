"""From when on recordings are old, whatever clocks have said."""

from dataclasses import replace

from service.store.waveform_port import WaveformFile, WaveformKind
from service.waveforms.ages import NotOldFrom

HOUR_NS = 3600 * 10**9
DAY_NS, YEAR_NS = 24 * HOUR_NS, 365 * 24 * HOUR_NS
NOW_NS = 1_767_225_600_000_000_000


def file_of(stop_ns: int, length_ns: int = HOUR_NS, unit: str = "U1") -> WaveformFile:
    """A recording that was found when it was finished."""
    span = (stop_ns - length_ns, stop_ns)
    kind = WaveformKind.CONTINUOUS
    return WaveformFile("here", kind, str(stop_ns), unit, *span, 1, 1, "", changed_ns=stop_ns)


def day_of(stop_ns: int, unit: str = "U1") -> list[WaveformFile]:
    """A day of recordings."""
    return [file_of(stop_ns - hour * HOUR_NS, unit=unit) for hour in range(24)]


def old(files: list[WaveformFile], now_ns: int = NOW_NS) -> list[WaveformFile]:
    """Those that are older than two days."""
    not_old = NotOldFrom(files, now_ns, 2 * DAY_NS)
    return [file for file in files if not_old.is_old(file)]


def test_ages_count_from_where_a_day_of_recordings_begins() -> None:
    newest = day_of(NOW_NS)
    since_ns = NOW_NS - 23 * HOUR_NS - 2 * DAY_NS
    gone, kept = file_of(since_ns - 1), file_of(since_ns)

    assert old([*newest, gone, kept]) == [gone]
    assert old([*newest[1:], gone]) == []  # which is less than a day


def test_a_recording_during_which_a_clock_was_set_is_no_day_of_recordings() -> None:
    across = file_of(NOW_NS + YEAR_NS, YEAR_NS)

    assert old([*day_of(NOW_NS), across], NOW_NS + YEAR_NS) == []


def test_what_a_device_records_in_the_year_2000_is_as_old_as_when_it_was_found() -> None:
    begun_anew = [
        replace(file_of(NOW_NS - 26 * YEAR_NS), changed_ns=NOW_NS - days * DAY_NS)
        for days in (2, 4)
    ]

    assert old([*day_of(NOW_NS), *begun_anew]) == begun_anew[1:]


def test_a_clock_that_is_behind_makes_less_old() -> None:
    files = [*day_of(NOW_NS), file_of(NOW_NS - 4 * DAY_NS)]

    assert len(old(files)) == 1
    assert old(files, NOW_NS - 3 * DAY_NS) == []


def test_each_unit_has_its_own_clock_and_what_has_no_unit_that_of_the_others() -> None:
    other, unknown = file_of(NOW_NS - 9 * DAY_NS, unit="U2"), file_of(NOW_NS - 9 * DAY_NS, 0, "")

    assert old([*day_of(NOW_NS), other, unknown]) == [unknown]
    assert old([*day_of(NOW_NS)[1:], other, unknown]) == []
