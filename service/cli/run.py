"""`padwatch run`."""

from contextlib import closing

from service.cli.options import PlantPath, PortOption
from service.runtime.child import start_child


def run(plant_file: PlantPath, port: PortOption = None) -> None:
    """Acquire, analyse, store and serve a plant until Ctrl-C or SIGTERM."""
    # imports take most of the start: those of the two processes run side by side
    with closing(start_child()) as child:
        from service.app.listener import listener_of
        from service.cli.processes import run_plant
        from service.runtime.process import leave
        from service.settings.plant import load_plant_file

        plant = load_plant_file(plant_file)
        with listener_of(plant, plant.service.port if port is None else port) as listener:
            run_plant(plant, listener, child=child)
        leave()
