"""Thousands of requests made up by schemathesis against a running service, for every role.

Prints how many there were, what they were answered and what is wrong: an answer that is not
documented or not as documented, a fault of the service, an invalid request that is taken for a
valid one. Ends with 1 if anything is.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import httpx2
import psutil
from fuzz_service import ROLES, Fuzzed, fuzzed_service

NO_LOGIN, FORGED = "no login", "forged"
NOT_CHECKED = ("positive_data_acceptance", "ignored_auth")
"""A valid request may be refused for what a schema cannot say (a start after its end); and who is
on the same computer sees the plant without a login, so that leaving it out changes nothing."""

ALWAYS_ALLOWED = {"400", "401", "403", "405", "408", "413", "414", "421", "429", "431"}
"""What the server answers itself before any operation is asked, or instead of one."""

FORGED_KEY = f"pw_{'0' * 12}_{'A' * 43}"
MIB = 1024 * 1024


@dataclass(frozen=True)
class Outcome:
    """What fuzzing in one role has come to."""

    n_cases: int
    statuses: Counter[str]
    undocumented: Counter[str]
    n_failures: int
    said: str


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--examples", type=int, default=40, help="for each operation and role")
    parser.add_argument("--seed", type=int, default=20261121)
    parser.add_argument("--phases", default="examples,coverage,fuzzing")
    parser.add_argument(
        "--roles", nargs="+", help="viewer, operator, engineer, admin, forged, 'no login'"
    )
    parser.add_argument("--past-years", type=float, default=0.2)
    parser.add_argument("--no-daq", action="store_true", help="without live data")
    parser.add_argument("--include", help="only operations whose path matches this")
    options = parser.parse_args()
    roles = options.roles or [*ROLES, FORGED, NO_LOGIN]
    with (
        tempfile.TemporaryDirectory() as folder,
        fuzzed_service(Path(folder), options.past_years, not options.no_daq, roles) as service,
    ):
        sys.exit(fuzz(service, options, roles, Path(folder)))


def fuzz(service: Fuzzed, options: argparse.Namespace, roles: list[str], folder: Path) -> int:
    measuring = psutil.Process(service.pid)
    # memory of a serving process that has ended cannot be read: that ends this program, too
    running = [measuring, *measuring.children()]
    paths = httpx2.get(f"{service.url}/api/v1/openapi.json", trust_env=False).json()["paths"]
    keys = {**service.keys, FORGED: FORGED_KEY, NO_LOGIN: None}
    outcomes = []
    print(f"RSS {rss_mib(running):.0f} MiB before")
    print(f"{'role':<10}{'cases':>8}{'2xx/3xx':>9}{'4xx':>8}{'5xx':>6}{'wrong':>7}{'RSS MiB':>9}")
    for role in roles:
        outcome = fuzz_as(keys[role], service.url, options, folder, paths)
        outcomes.append(outcome)
        by_class = _classes(outcome.statuses)
        n_wrong = outcome.n_failures + outcome.undocumented.total()
        counts = f"{by_class['2'] + by_class['3']:>9}{by_class['4']:>8}{by_class['5']:>6}"
        memory = f"{rss_mib(running):>9.0f}"
        print(f"{role:<10}{outcome.n_cases:>8}{counts}{n_wrong:>7}{memory}", flush=True)
    return report(outcomes, service.log.read_text(encoding="utf-8"))


def rss_mib(processes: list[psutil.Process]) -> float:
    return sum(process.memory_info().rss for process in processes) / MIB


def fuzz_as(
    key: str | None, url: str, options: argparse.Namespace, folder: Path, paths: Any
) -> Outcome:
    events = folder / "events.ndjson"
    # nobody in particular is not told which methods there are
    not_checked = (*NOT_CHECKED, *(("unsupported_method",) if key == FORGED_KEY else ()))
    command = [
        *(str(Path(sys.executable).with_name("st")), "run", f"{url}/api/v1/openapi.json"),
        *("--phases", options.phases, "--max-examples", str(options.examples)),
        *("--seed", str(options.seed), "--exclude-checks", ",".join(not_checked)),
        *("--generation-database", "none", "--continue-on-failure", "--no-color"),
        *("--generation-with-security-parameters", "false"),
        *("--warnings", "off", "--wait-for-schema", "60", "--request-timeout", "30"),
        *("--suppress-health-check", "all"),  # of making requests up, on a slow computer
        *("--report", "ndjson", "--report-ndjson-path", str(events)),
        *(() if key is None else ("--header", f"Authorization: Bearer {key}")),
        *(() if options.include is None else ("--include-path-regex", options.include)),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    outcome = outcome_of(events, paths, done.stdout + done.stderr)
    # a request that was not answered at all is an error to it, and no failure
    return outcome if outcome.n_failures or not done.returncode else replace(outcome, n_failures=1)


def outcome_of(events: Path, paths: Any, said: str) -> Outcome:
    statuses, undocumented = Counter[str](), Counter[str]()
    n_failures = 0
    with events.open(encoding="utf-8") as lines:
        for line in lines:
            told = json.loads(line).get("ScenarioFinished")
            if told is None:
                continue
            recorder = told["recorder"]
            n_failures += sum(
                check["status"] == "failure"
                for checks in recorder.get("checks", {}).values()
                for check in checks
            )
            for id_, interaction in recorder.get("interactions", {}).items():
                status = str((interaction.get("response") or {}).get("status_code", "none"))
                statuses[status] += 1
                case = recorder["cases"].get(id_, {}).get("value", {})
                if not _is_documented(paths, case, status):
                    undocumented[f"{case.get('method')} {case.get('path')}: {status}"] += 1
    return Outcome(statuses.total(), statuses, undocumented, n_failures, said)


def report(outcomes: list[Outcome], log: str) -> int:
    for outcome in outcomes:
        if outcome.n_failures:
            print(outcome.said)
        for what, times in outcome.undocumented.items():
            print(f"not documented: {what} ({times} times)")
    n_cases = sum(outcome.n_cases for outcome in outcomes)
    statuses = sum((outcome.statuses for outcome in outcomes), Counter[str]())
    n_wrong = sum(outcome.n_failures + outcome.undocumented.total() for outcome in outcomes)
    n_tracebacks = log.count("Traceback")
    print(", ".join(f"{status}: {n}" for status, n in sorted(statuses.items())))
    print(f"{n_cases} cases, {n_wrong} wrong, {n_tracebacks} tracebacks in the service's log")
    if n_tracebacks:
        print(log[-4000:])
    return int(n_wrong > 0 or n_tracebacks > 0 or n_cases == 0)


def _is_documented(paths: Any, case: Any, status: str) -> bool:
    """Whether the operation itself documents it; the word "default" does not count."""
    operation = paths.get(case.get("path"), {}).get(str(case.get("method")).lower())
    return operation is None or status in operation["responses"] or status in ALWAYS_ALLOWED


def _classes(statuses: Counter[str]) -> Counter[str]:
    found = Counter[str]()
    for status, n in statuses.items():
        found[status[0]] += n
    return found


if __name__ == "__main__":
    main()
