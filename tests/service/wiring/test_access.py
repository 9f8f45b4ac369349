"""Who must log in, by what a plant file says, and where nothing starts at all."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from acquisition.clock import SystemClock
from service.replay import replayed_plant
from service.security.roles import Role
from service.settings.access import AccessSettings, TlsSettings
from service.settings.loading import load_plant_file
from service.settings.plant import PlantFile
from service.store.sqlite import SqliteStore
from service.wiring.access import access_desk

DEMO = Path(__file__).parents[3] / "deploy" / "demo.toml"
TLS = TlsSettings(certificate="a.crt", key="a.key")


@pytest.fixture
def store(tmp_path: Path) -> Iterator[SqliteStore]:
    opened = SqliteStore(tmp_path / "padwatch.sqlite3")
    yield opened
    opened.close()


def plant_with(login: bool = False, **service: object) -> PlantFile:
    plant = load_plant_file(DEMO)
    changed = plant.service.model_copy(update=service)
    access = AccessSettings(login=login)
    return plant.model_copy(update={"service": changed, "access": access})


@pytest.mark.parametrize(
    ("plant", "everybody"),
    [
        (plant_with(), False),
        (plant_with(host="::1"), False),
        (plant_with(host="localhost", tls=TLS), False),
        (plant_with(login=True), True),
        (plant_with(socket="/run/padwatch/http.sock"), True),
        (plant_with(host="0.0.0.0", tls=TLS), True),  # noqa: S104
    ],
)
def test_whoever_is_not_surely_on_this_computer_logs_in(
    store: SqliteStore, plant: PlantFile, everybody: bool
) -> None:
    store.access.accounts.add("anna", Role.ADMIN, "$argon2id$", 0)

    assert access_desk(plant, store.access, SystemClock()).asks_everybody is everybody


async def test_a_token_for_setting_up_is_drawn_only_where_nobody_could_log_in(
    store: SqliteStore,
) -> None:
    clock = SystemClock()
    closed = access_desk(plant_with(login=True), store.access, clock)
    open_ = access_desk(plant_with(), store.access, clock)

    assert await open_.offer_set_up() is None
    assert await closed.offer_set_up() is not None
    store.access.accounts.add("anna", Role.ADMIN, "$argon2id$", 0)
    assert await closed.offer_set_up() is None


def test_a_replay_is_for_this_computer_and_asks_for_logins_as_the_plant_does(
    tmp_path: Path,
) -> None:
    plant = plant_with(login=True, host="0.0.0.0", tls=TLS)  # noqa: S104
    replayed = replayed_plant(plant, ["U1"], tmp_path)

    assert (replayed.service.host, replayed.service.tls) == ("127.0.0.1", None)
    assert replayed.access.login
