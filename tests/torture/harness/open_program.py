"""The command; clients on this computer need no login, as with `padwatch demo`."""

import sys
from functools import partial

from service.cli import processes
from service.cli.main import main

processes.run_plant = partial(processes.run_plant, is_demo=True)
if sys.argv[1] == "serve":
    from service.app import replica_process

    replica_process.access_desk = partial(replica_process.access_desk, is_demo=True)

if __name__ == "__main__":
    main()
