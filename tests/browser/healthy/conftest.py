"""A plant in good health, shared by tests that leave it so."""

from collections.abc import Iterator

import pytest
from real_plant import Plant


@pytest.fixture(scope="package")
def plant(chromium: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Plant]:  # noqa: ARG001
    with Plant(tmp_path_factory.mktemp("healthy")) as running:
        patient = running.settings.replace("link_lost_after_s = 2.0", "link_lost_after_s = 60.0")
        running.settings = patient  # a DAQ that gets no processor for a while is in good health
        running.start_daq()
        running.start_service()
        yield running
