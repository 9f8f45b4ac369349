"""A year of trends: what gathering it beforehand costs, and how fast it is read then.

One bearing of a plant in which every quantity has a number all the time, a result every 0.85 s,
and a condition that moves across the bounds of cells: the worst case. The roll-ups of a year
(hours), of a month (ten minutes) and of eight days (minutes) are written as the program would have
written them, and behind them two hours of single results, which the program gathers itself.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from core.condition.cells import CellGrid
from core.condition.operating_state import OperatingState
from core.monitor.catalogue import CATALOGUE
from core.units import NS_PER_S
from service.api.answers import json_of
from service.api.routes.trends import trend_groups, trend_model
from service.store.buckets import Summaries
from service.store.port import TrendQuery, ValueRange
from service.store.rollups.gathering import SET_MARK
from service.store.rollups.rows import HOUR_NS, WIDTHS_NS, Cells, Conditions
from service.store.rollups.writing import insert_cells
from service.store.series import Layout, columns_of, remember_layout, series_of
from service.store.sqlite import SqliteStore

N_BEARINGS = 60
HOP_NS = 853_333_333
NOW_NS = 1_795_000_000_000_000_000 // HOUR_NS * HOUR_NS
DAY_NS = 24 * HOUR_NS
YEAR_NS = 365 * DAY_NS
KEPT_NS = {WIDTHS_NS[0]: 8 * DAY_NS, WIDTHS_NS[1]: 32 * DAY_NS, WIDTHS_NS[2]: YEAR_NS}
LIVE_NS = 2 * HOUR_NS
CELLS_PER_SPAN = 2
MOST_MS = 300.0
COLUMNS = columns_of(CATALOGUE)


def simulated(random: np.random.Generator, end_ns: int, width_ns: int, length_ns: int) -> Cells:
    """Roll-ups in which every span has readings in two cells of eccentricity."""
    start_ns = np.repeat(np.arange(end_ns - length_ns, end_ns, width_ns), CELLS_PER_SPAN)
    n, phase = start_ns.size, start_ns / YEAR_NS * 2.0 * np.pi
    e = 0.30 + 0.05 * np.round(2.0 * np.sin(phase)) + 0.05 * (np.arange(n) % CELLS_PER_SPAN)
    oil_c = 45.0 + 10.0 * np.sin(phase)
    state = np.where(
        np.sin(300.0 * phase) > 0.0, OperatingState.FULL_LOAD, OperatingState.PART_LOAD
    )
    n_readings = np.full(n, max(1, width_ns // HOP_NS // CELLS_PER_SPAN))
    mean = random.normal(1e9, 1e7, (n, len(COLUMNS)))
    mean[:, COLUMNS.index("eccentricity_ratio")] = e + 0.02
    count = np.repeat(n_readings[:, np.newaxis], len(COLUMNS), axis=1)
    level = np.zeros(mean.shape, dtype=np.uint8)
    numbers = (count, mean, 0.999 * mean, 1.001 * mean, level)
    conditions = Conditions(state, n_readings, e + 0.001, e + 0.045, oil_c, oil_c + 0.1)
    return Cells(conditions, Summaries(COLUMNS, start_ns, *numbers))


def fill_rollups(store: SqliteStore, end_ns: int) -> dict[int, float]:
    """Bytes of one roll-up span, by width."""
    random, found = np.random.default_rng(1), {}
    for width_ns, length_ns in KEPT_NS.items():
        before = _n_bytes(store)
        with store._writing() as writer:  # noqa: SLF001  as the program does it
            series = series_of(writer, "U1", "UJB")
            insert_cells(writer, series, width_ns, simulated(random, end_ns, width_ns, length_ns))
            writer.execute(SET_MARK, (series, end_ns))
        found[width_ns] = (_n_bytes(store) - before) / (length_ns / width_ns)
    return found


def _n_bytes(store: SqliteStore) -> int:
    with store._reader() as reader:  # noqa: SLF001
        n_pages, n_free = (
            reader.execute(f"PRAGMA {name}").fetchone()[0]
            for name in ("page_count", "freelist_count")
        )
        return int((n_pages - n_free) * reader.execute("PRAGMA page_size").fetchone()[0])


def fill_rows(store: SqliteStore, start_ns: int) -> tuple[int, float]:
    """How many single results were written, and bytes of one."""
    random, before = np.random.default_rng(2), _n_bytes(store)
    times_ns = range(start_ns, start_ns + LIVE_NS, HOP_NS)
    with store._writing() as writer:  # noqa: SLF001
        series = series_of(writer, "U1", "UJB")
        layout = remember_layout(writer, Layout.of(COLUMNS))
        quality = bytes(len(COLUMNS))
        values = random.normal(1e9, 1e7, (len(times_ns), len(COLUMNS)))
        e = values[:, COLUMNS.index("eccentricity_ratio")] = random.normal(0.35, 0.005, len(values))
        rows = [
            (
                *(series, at, 0, 0, 0, 1, 1.0, "slow_channel", ratio, 45.0),
                *(layout, numbers.tobytes(), quality),
                *(None, None, int(OperatingState.FULL_LOAD), 1),
            )
            for at, ratio, numbers in zip(times_ns, e.tolist(), values, strict=True)
        ]
        marks = ",".join("?" * len(rows[0]))
        writer.executemany(f"INSERT INTO assessment VALUES ({marks})", rows)  # noqa: S608
    return len(rows), (_n_bytes(store) - before) / len(rows)


def gather(store: SqliteStore, now_ns: int) -> tuple[float, float]:
    """CPU seconds spent on gathering all there is, and the longest that others had to wait."""
    begun_s, longest_s = time.process_time(), 0.0
    while due := store.rollups.due(now_ns):
        piece_s = time.perf_counter()
        store.rollups.gather(due[0], now_ns)
        longest_s = max(longest_s, time.perf_counter() - piece_s)
    return time.process_time() - begun_s, longest_s


def gather_by_the_minute(store: SqliteStore, start_ns: int) -> float:
    """CPU seconds of a minute's work for one bearing, live."""
    minutes = range(start_ns, start_ns + LIVE_NS + 1, WIDTHS_NS[0])
    begun_s = time.process_time()
    for now_ns in minutes:
        for series in store.rollups.due(now_ns):
            store.rollups.gather(series, now_ns)
    return (time.process_time() - begun_s) / len(minutes)


def cpu_ms(do: Callable[[], object], n_times: int) -> float:
    spent_s = []
    for _ in range(n_times):
        begun_s = time.process_time()
        do()
        spent_s.append(time.process_time() - begun_s)
    return 1e3 * min(spent_s)


def queries(end_ns: int, max_points: int) -> dict[str, TrendQuery]:
    names = columns_of(CATALOGUE[:12])

    def asked(length_ns: int, **more: object) -> TrendQuery:
        arguments = ("U1", "UJB", names, end_ns - length_ns, end_ns, max_points, 3 * HOP_NS)
        return TrendQuery(*arguments, **more)  # type: ignore[arg-type]

    return {
        "a year": asked(YEAR_NS),
        "a year, full load": asked(YEAR_NS, states=(OperatingState.FULL_LOAD,)),
        "a year, eccentricity 0.30 to 0.40": asked(
            YEAR_NS, eccentricity_ratio=ValueRange(0.30, 0.40)
        ),
        "a month": asked(30 * DAY_NS),
        "a week": asked(7 * DAY_NS),
        "a day": asked(DAY_NS),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=5)
    n_times = parser.parse_args().times
    with tempfile.TemporaryDirectory() as folder:
        store = SqliteStore(Path(folder) / "year.sqlite3")
        start_ns = NOW_NS - LIVE_NS
        span_bytes = fill_rollups(store, start_ns)
        n_rows, row_bytes = fill_rows(store, start_ns)
        cpu_s = gather_by_the_minute(store, start_ns)
        print_costs(span_bytes, row_bytes, cpu_s)
        print_backlog(Path(folder) / "old.sqlite3", n_rows)
        slowest_ms = print_times(store, n_times)
        store.close()
    print(f"\nslowest of a year {slowest_ms:.0f} ms; wanted: at most {MOST_MS:g}")
    sys.exit(slowest_ms > MOST_MS)


def print_costs(span_bytes: dict[int, float], row_bytes: float, cpu_s: float) -> None:
    print(f"{'a bearing and a year':<30}{'GB':>8}")
    print(f"{'single results, each 0.85 s':<30}{YEAR_NS / HOP_NS * row_bytes / 1e9:>8.2f}")
    for width_ns, one in span_bytes.items():
        words = f"roll-ups of {width_ns // NS_PER_S} s"
        print(f"{words:<30}{YEAR_NS / width_ns * one / 1e9:>8.3f}")
    share = 100.0 * N_BEARINGS * cpu_s / 60.0
    print(f"\ngathering live: {1e3 * cpu_s:.1f} ms CPU a minute for a bearing,", end=" ")
    print(f"{share:.2f} % of a core for {N_BEARINGS}")


def print_backlog(path: Path, n_rows: int) -> None:
    store = SqliteStore(path)
    fill_rows(store, NOW_NS - LIVE_NS)
    cpu_s, longest_s = gather(store, NOW_NS)
    store.close()
    print(f"gathering an old database: {n_rows / cpu_s:.0f} results a CPU second,", end=" ")
    print(f"the writer held for at most {1e3 * longest_s:.0f} ms\n")


def print_times(store: SqliteStore, n_times: int) -> float:
    slowest_ms = 0.0
    print(f"{'trend of 12 quantities, as JSON':<40}{'points':>8}{'buckets':>9}{'CPU ms':>8}")
    for max_points in (1000, 5000):
        for words, query in queries(NOW_NS, max_points).items():

            def answer(query: TrendQuery = query) -> bytes:
                return json_of(trend_model(query, store.trend(query)))

            spent_ms, n = cpu_ms(answer, n_times), len(store.trend(query).time_ns)
            print(f"{words:<40}{max_points:>8}{n:>9}{spent_ms:>8.0f}")
            if words.startswith("a year") and max_points == 1000:
                slowest_ms = max(slowest_ms, spent_ms)
    year = queries(NOW_NS, 1000)["a year"]
    for by in ("state", "eccentricity"):
        spent_ms = cpu_ms(lambda by=by: trend_groups(store, year, by, CellGrid()), n_times)  # type: ignore[misc]
        print(f"{f'a year, by {by}, before JSON':<40}{1000:>8}{'':>9}{spent_ms:>8.0f}")
    return slowest_ms


if __name__ == "__main__":
    main()
