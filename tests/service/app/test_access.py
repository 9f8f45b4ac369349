"""Who must log in, by what a plant file says, and where nothing starts at all."""

from pathlib import Path

import pytest

from acquisition.clock import SystemClock
from service.app.recordings import replayed_plant
from service.app.web import access_desk
from service.settings.loading import load_plant_file
from service.settings.plant import PlantFile
from service.settings.processes import AccessSettings, TlsSettings
from service.store.access.identities import Role
from service.store.sqlite import SqliteStore

DEMO = Path(__file__).parents[3] / "deploy" / "demo.toml"
TLS = TlsSettings(certificate="a.crt", key="a.key")


def plant_with(login: bool = False, **service: object) -> PlantFile:
    plant = load_plant_file(DEMO)
    changed = plant.service.model_copy(update=service)
    access = AccessSettings(login=login)
    return plant.model_copy(update={"service": changed, "access": access})


@pytest.mark.parametrize(
    ("plant", "local_role"),
    [
        (plant_with(), Role.VIEWER),
        (plant_with(host="::1"), Role.VIEWER),
        (plant_with(host="localhost", tls=TLS), Role.VIEWER),
        (plant_with(login=True), None),
        (plant_with(socket="/run/padwatch/http.sock"), None),
        (plant_with(host="0.0.0.0", tls=TLS), None),  # noqa: S104
    ],
)
def test_who_is_on_this_computer_may_read_and_others_log_in(
    store: SqliteStore, plant: PlantFile, local_role: Role | None
) -> None:
    store.access.accounts.add("anna", Role.ADMIN, "$argon2id$", 0)

    assert access_desk(plant, store.access, SystemClock()).local_role is local_role
    in_demo = access_desk(plant, store.access, SystemClock(), is_demo=True).local_role
    assert in_demo is (None if local_role is None else Role.ADMIN)


async def test_a_token_for_setting_up_is_drawn_only_where_nobody_could_log_in(
    store: SqliteStore,
) -> None:
    clock = SystemClock()
    closed = access_desk(plant_with(login=True), store.access, clock)
    plain = access_desk(plant_with(), store.access, clock)
    demo = access_desk(plant_with(), store.access, clock, is_demo=True)

    assert await demo.offer_set_up() is None
    for desk in (closed, plain):
        assert await desk.offer_set_up() is not None
    store.access.accounts.add("anna", Role.ADMIN, "$argon2id$", 0)
    for desk in (closed, plain):
        assert await desk.offer_set_up() is None


def test_a_replay_is_for_this_computer_and_asks_for_logins_as_the_plant_does(
    tmp_path: Path,
) -> None:
    plant = plant_with(login=True, host="0.0.0.0", tls=TLS)  # noqa: S104
    replayed = replayed_plant(plant, ["U1"], tmp_path)

    assert (replayed.service.host, replayed.service.tls) == ("127.0.0.1", None)
    assert replayed.access.login
