"""Plant the bugs of `mutants.toml`, one at a time, and see whether the fast tier catches them.

Each bug goes into a copy of the tree; the tests that it names run there until the first failure.
Prints one line a bug, and how many were caught; exits with 1 if a bug stands in no file, or if
fewer than `REQUIRED` of all are caught.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
REQUIRED = 0.95
COPIED = ("core", "acquisition", "service", "tests", "deploy", "docs", "pyproject.toml")
LEFT_OUT = shutil.ignore_patterns("node_modules")

FAILED = 1
"""Exit code of pytest if a test failed; any other one but 0 says nothing of the bug."""


@dataclass(frozen=True)
class Mutant:
    """A bug: a text that stands once in a file, what replaces it, and which tests must notice."""

    bug: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    def plant(self, tree: Path) -> None:
        """Change the file of a tree.

        Raises
        ------
        ValueError
            If the text does not stand in the file exactly once.
        """
        path = tree / self.file
        text = path.read_text(encoding="utf-8")
        if text.count(self.old) != 1:
            raise ValueError(f"{self.file} holds {text.count(self.old)} times: {self.old!r}")
        path.write_text(text.replace(self.old, self.new), encoding="utf-8")


def mutants() -> list[Mutant]:
    """All bugs, in the order of the file."""
    document = tomllib.loads((Path(__file__).parent / "mutants.toml").read_text(encoding="utf-8"))
    return [Mutant(**{**row, "tests": tuple(row["tests"])}) for row in document["mutant"]]


def run_tests(tree: Path, tests: Iterable[str], mutant: Mutant | None = None) -> int:
    """Run tests in a copy of a tree, with a bug or without; return the exit code of pytest.

    Raises
    ------
    ValueError
        As `Mutant.plant`; also if the tests could not be run at all.
    """
    with tempfile.TemporaryDirectory(prefix="padwatch-mutant-") as folder:
        copy = Path(folder)
        for name in COPIED:
            if (tree / name).is_dir():
                shutil.copytree(tree / name, copy / name, ignore=LEFT_OUT)
            else:
                shutil.copy(tree / name, copy / name)
        if mutant is not None:
            mutant.plant(copy)
        run = subprocess.run(
            [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests],
            cwd=copy,
            env={**os.environ, "PYTHONPATH": str(copy)},
            capture_output=True,
            text=True,
            check=False,
        )
    if run.returncode not in (0, FAILED) or (mutant is None and run.returncode):
        raise ValueError(f"pytest ended with {run.returncode}: {run.stdout[-2000:]}")
    return run.returncode


def main() -> int:
    """Run all bugs or some; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tree", type=Path, default=ROOT, help="tree to plant them in")
    parser.add_argument("--only", default="", help="part of a file's name or of a bug's words")
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    chosen = [m for m in mutants() if given.only in m.file or given.only in m.bug]
    began_s = time.monotonic()
    with ThreadPoolExecutor(given.workers) as pool:
        everything = sorted({test for mutant in chosen for test in mutant.tests})
        unharmed = pool.submit(run_tests, given.tree, everything)
        found = list(pool.map(lambda mutant: _is_caught(mutant, given.tree), chosen))
        unharmed.result()  # what fails without a bug would count as having caught one
    n_caught = sum(found)
    print(f"{n_caught} of {len(chosen)} caught in {time.monotonic() - began_s:.0f} s")
    return 0 if n_caught >= REQUIRED * len(chosen) and chosen else 1


def _is_caught(mutant: Mutant, tree: Path) -> bool:
    caught = run_tests(tree, mutant.tests, mutant) == FAILED
    print(f"{'caught' if caught else 'MISSED'}  {mutant.file}: {mutant.bug}", flush=True)
    return caught


if __name__ == "__main__":
    sys.exit(main())
