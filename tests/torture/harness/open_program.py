"""The command, whose `run` asks nobody on this computer to log in, as `padwatch demo` does."""

from functools import partial

from service.cli import processes
from service.cli.main import main

processes.run_plant = partial(processes.run_plant, is_demo=True)

if __name__ == "__main__":
    main()
