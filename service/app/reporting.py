"""How a process that analyses is seen and asked by those that only serve."""

from collections.abc import Callable, Collection, Mapping

from service.app.analysis import Analysis
from service.cluster.reported_commands import CarryingOut
from service.cluster.reported_state import Reporter, process_name
from service.runtime.heartbeats import Loop


def reporting_loops(analysis: Analysis, held: Callable[[], Collection[str]]) -> Mapping[str, Loop]:
    """Loops that write down what is known of units, and carry out what operators ask of them.

    Parameters
    ----------
    held
        Units that are this process's just now; with `PLANT` where it also tells of alarms that are
        of no unit, and `SHARED` where it does the shared work.
    """
    ground, process = analysis.ground, process_name()
    store, parts = ground.store, (analysis.alarms, analysis.films)
    reporter = Reporter(
        process, ground.plant.unit, held, ground.live, *parts, store.unit_states, ground.clock
    )
    carrying_out = CarryingOut(process, held, *parts, analysis.recorder, store, ground.clock)
    return {"report": reporter.run, "commands": carrying_out.run}
