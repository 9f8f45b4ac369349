"""Which machine it is."""

from pathlib import Path

import pytest

from service.store.highwater.host import host_id


def test_machines_are_told_apart_without_giving_away_their_names(tmp_path: Path) -> None:
    names = [tmp_path / "one", tmp_path / "other"]
    for n, name in enumerate(names):
        name.write_text(f"{n:032x}\n")
    ids = [host_id(name) for name in names]

    assert ids[0] != ids[1]
    assert ids[0] == host_id(names[0])
    assert f"{0:032x}" not in ids[0]


@pytest.mark.parametrize("text", ["", "\n", "uninitialized\n"])
def test_a_machine_without_a_name_has_none(tmp_path: Path, text: str) -> None:
    (tmp_path / "machine-id").write_text(text)

    assert host_id(tmp_path / "machine-id") == host_id(tmp_path / "none") == ""
