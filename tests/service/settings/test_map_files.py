"""Register maps in files: the examples load, and a wrong one is refused with line, key and fix."""

from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.modbus.decoding import MapDecoder
from core.spectra.polls import VectorPart, VectorRow
from service.settings.map_file import load_map_file
from service.settings.toml_file import TomlFileError

MAPS = Path(__file__).parents[3] / "deploy" / "maps"


@pytest.mark.parametrize("path", sorted(MAPS.glob("*.toml")), ids=lambda path: path.name)
def test_every_example_can_be_read(path: Path) -> None:
    decoder = MapDecoder(load_map_file(path).register_map())

    assert decoder.plan.spans
    assert all(request.count <= 125 for request in decoder.plan.spans)


def test_an_skf_like_rack_is_read_as_its_manual_demands() -> None:
    registers = load_map_file(MAPS / "vector-rack-skf-like.toml").register_map()
    requests = [(r.address, r.count) for r in MapDecoder(registers).plan.spans]

    assert (608, 14) in requests
    amplitude = registers.values[0]
    assert amplitude.id == VectorRow("ujb_shaft_x", VectorPart.ORDER1_AMPLITUDE).id
    assert amplitude.scale == 0.5, "peak-to-peak becomes zero-to-peak"
    assert registers.values[1].scale == -0.1, "lag becomes lead"


MINIMAL = """
base = 1
[[value]]
channel = "a"
address = 10
type = "float32"
[[value]]
channel = "b"
address = 20
"""


@pytest.fixture
def mistakes(tmp_path: Path) -> Callable[[str], str]:
    """Everything that is said of a map."""

    def load(text: str) -> str:
        path = tmp_path / "map.toml"
        path.write_text(text)
        with pytest.raises(TomlFileError) as refusal:
            load_map_file(path)
        return str(refusal.value).replace(f"{tmp_path}/", "")

    return load


FLAG = "[[value.flag]]\naddress = 30\n"
FIELDS = '["day", "day", "year", "hour", "minute", "second"]'
CALENDAR = f'[time]\nkind = "calendar"\nfirst = {{ address = 50 }}\nfields = {FIELDS}\n'


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("address = 20", "address = 11", "map.toml:9: value[2].address: lies on a"),
        ('"float32"', '"float16"', "map.toml:6: value[1].type = 'float16'"),
        ("address = 10", "address = 0", "value[1].address: must be 1 to 65535"),
        ("base = 1", "base = 2", "map.toml:2: base = 2: must be 0, 1, 10001"),
        ("base = 1", "bass = 1", "map.toml:2: bass = 1: Extra inputs"),
    ],
)
def test_a_wrong_value_of_a_map_is_refused_with_line_key_and_fix(
    mistakes, old: str, new: str, said: str
) -> None:
    assert old in MINIMAL
    assert said in mistakes(MINIMAL.replace(old, new, 1))
    assert "value: Field required" in mistakes("")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("scale = 0.0", "value[2].scale: must not be 0"),
        ('detector = "pp"', "value[2].detector"),
        ('quantity = "order1_amplitude"', 'value[2].detector: must be "pk", "pp" or "rms"'),
        ('quantity = "order1_phase"', 'value[2].phase: must be "lag" or "lead"'),
        ("bit = 3", "value[2].bit: is the number of a bit"),
        ("invalid_values = [0.5]", "value[2].invalid_values: must each be a whole number of 16 b"),
        ("scale_register = { address = 25 }", "scale_register: is read in another request"),
        ("full_scale = { minimum = 0.0 }", "value[2].full_scale.maximum: give either"),
        ("invalid_below = nan", "invalid_below"),
        ("[[together]]\naddress = 11\ncount = 5", "together: the block from 11 cuts"),
        ("[[together]]\naddress = 40\ncount = 126", "together[1].count = 126"),
        ('[time]\nkind = "epoch"\nseconds = { address = 0 }', "time.address: must be 1"),
        (CALENDAR, "time.fields: must name each of year, month"),
        ('"\\n" = 1', "value[2].\\n = 1: Extra inputs"),
        (FLAG + "mask = 0\nset_means = 'bad'", "map.toml:12: value[2].flag[1].mask = 0: Input"),
        (FLAG, "value[2].flag[1].set_means: must be given"),
        (FLAG + "type = 'float32'\nset_means = 'bad'", "map.toml:12: value[2].flag[1].type: mu"),
        ("base = ", "not TOML"),
    ],
)
def test_a_wrong_line_behind_a_map_is_refused_with_key_and_fix(
    mistakes, text: str, said: str
) -> None:
    assert said in mistakes(f"{MINIMAL}{text}\n")
