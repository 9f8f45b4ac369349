"""The planted bugs of `make mutants` fit the tree that they are planted in."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_every_planted_bug_changes_one_place_and_names_tests_that_exist():
    text = (Path(__file__).parent / "mutants.toml").read_text(encoding="utf-8")
    for bug in tomllib.loads(text)["mutant"]:
        found = (ROOT / bug["file"]).read_text(encoding="utf-8").count(bug["old"])
        assert (found, bug["old"] == bug["new"]) == (1, False), bug["bug"]
        assert all((ROOT / path).exists() for path in bug["tests"]), bug["bug"]
