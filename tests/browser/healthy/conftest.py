"""A plant in good health, shared by tests that leave it so."""

from collections.abc import Iterator

import pytest
from real_plant import Plant


@pytest.fixture(scope="package")
def plant(chromium: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Plant]:  # noqa: ARG001
    with Plant(tmp_path_factory.mktemp("healthy")) as running:
        running.start_daq()
        running.start_service()
        yield running
