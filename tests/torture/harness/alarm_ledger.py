"""What alarms must have told of the exceedances that the truth holds: each once, with a letter."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from core.alarms.alarm import AlarmChange, AlarmEvent
from harness.ledger_plant import RECEIVER, LedgerPlant
from harness.lives import Rows
from harness.truth import BEARINGS, Spell, Truth
from service.store.port import AlarmQuery
from service.store.store import Store

if TYPE_CHECKING:
    from harness.checker import Case, Findings

PAGE = 5000


def alarm_faults(case: "Case", rows: Mapping[str, Rows]) -> None:
    """Add what is wrong with the alarms of a store, beside its results by unit, to the findings."""
    found, watch = case.found, case.watch
    events = list(_events(case.store))
    chains: dict[str, list[AlarmEvent]] = defaultdict(list)
    for event in events:
        chains[event.identity.id].append(event)
    for alarm, chain in chains.items():
        _check_chain(found, alarm, chain)
    there = {(event.identity.id, event.number) for event in events}
    found.lost += [
        f"event {number} of {alarm}"
        for alarm, number in watch.events
        if (alarm, number) not in there
    ]
    kept = {(event.identity.id, str(event.change), event.occurrence) for event in events}
    found.lost += [f"promised: {one}" for one in watch.promised - kept]
    found.n_promised = len(watch.promised)
    for unit, its in rows.items():
        _check_unit(case, unit, its, chains)
    _check_letters(found, case.store, events)


def _events(store: Store) -> Iterator[AlarmEvent]:
    """All, oldest first."""
    pages, before = [], 2**63 - 1
    while page := store.alarm_events(AlarmQuery(before=before, limit=PAGE)):
        pages += page
        before = page[-1].id
    return (stored.event for stored in reversed(pages))


def _check_chain(found: "Findings", alarm: str, chain: Sequence[AlarmEvent]) -> None:
    """An alarm goes on where it was, whatever happened to the service in between."""
    numbers = [event.number for event in chain]
    if numbers != list(range(1, len(chain) + 1)):
        found.alarms.append(f"{alarm}: events {numbers}")
    for before, event in pairwise(chain):
        if event.state_before != before.state_after:
            found.alarms.append(f"{alarm}: {before.state_after} became {event.state_before}")
        if event.change is before.change is AlarmChange.RAISED:
            found.alarms.append(f"{alarm}: raised twice, {before.time_ns} and {event.time_ns}")


def _check_unit(
    case: "Case", unit: str, rows: Rows, chains: Mapping[str, Sequence[AlarmEvent]]
) -> None:
    found, plant = case.found, case.plant
    truth = Truth(plant.seed, plant.units.index(unit) + 1, plant.rate_hz)
    spells = list(truth.spells(0, case.offered.samples[unit, 1]))
    for number, bearing in enumerate(BEARINGS):
        mine = [spell for spell in spells if spell.bearing == number]
        for axis in "xy":
            name = f"order1_shaft_{axis}_um_pk"
            values = sorted(
                (key[1], row[name][0]) for key, row in rows.items() if key[0] == bearing
            )
            alarm = f"{unit}:{bearing}:order1_shaft_{axis}"
            chain = chains.get(alarm, [])
            told = [
                (event.change, case.index_of(event.time_ns))
                for event in chain
                if event.change in (AlarmChange.RAISED, AlarmChange.RETURNED)
            ]
            found.alarms += [f"{alarm}: {one}" for one in _untrue(told, mine, plant)]
            stops = [case.index_of(time_ns) for time_ns, _ in values]
            raised = [at for change, at in told if change is AlarmChange.RAISED]
            for spell in _demanded(mine, stops, plant):
                found.n_exceedances += 1
                if not any(spell.start < at for at in raised if at <= spell.stop):
                    found.alarms.append(f"{alarm}: {spell} was not told of")


def _untrue(
    told: Sequence[tuple[AlarmChange, int]], spells: Sequence[Spell], plant: LedgerPlant
) -> Iterator[str]:
    """Alarms without an exceedance, and ends in the middle of one; a segment late is in time."""
    exceedances = [spell for spell in spells if spell.kind == "exceedance"]
    for change, at in told:
        late = at - plant.segment_samples
        if change is AlarmChange.RAISED:
            if not any(spell.start < at and late <= spell.stop for spell in exceedances):
                yield f"told for nothing at {at}"
        elif any(spell.start < late and at <= spell.stop for spell in exceedances):
            yield f"returned at {at}, too early"


def _demanded(spells: Sequence[Spell], stops: Sequence[int], plant: LedgerPlant) -> Iterator[Spell]:
    """Exceedances that begin and last within results, for longer than an average and two polls."""
    there = set(stops)
    least = plant.n_segments * plant.hop_samples + plant.segment_samples
    lost = [spell for spell in spells if spell.kind == "lost"]
    for spell in spells:
        if spell.kind != "exceedance" or spell.stop - spell.start < least:
            continue
        if any(other.start < spell.stop and other.stop > spell.start for other in lost):
            continue
        mine = [stop for stop in stops if spell.start < stop <= spell.stop]
        before = bool(mine) and mine[0] - plant.hop_samples in there
        whole = all(b - a == plant.hop_samples for a, b in pairwise(mine))
        if before and whole and (len(mine) + 1) * plant.hop_samples >= least:
            yield spell


def _check_letters(found: "Findings", store: Store, events: Sequence[AlarmEvent]) -> None:
    letters = store.outbox.waiting(RECEIVER, 1_000_000)
    queued = Counter(letter.event_id for letter in letters)
    found.duplicated += [f"letter {id_}" for id_, n in queued.items() if n > 1]
    raised = [
        event
        for event in events
        if event.change in (AlarmChange.RAISED, AlarmChange.RETURNED)
        and event.identity.kind in ("order1_shaft_x", "order1_shaft_y")
    ]
    if len(raised) != len(letters):
        found.alarms.append(f"{len(raised)} events have {len(letters)} letters")
