"""A plant with a past: readings, trends and a learned baseline."""

from collections.abc import Iterator

import pytest
from real_plant import DEMO_LIFE, Plant


@pytest.fixture(scope="package")
def plant(chromium: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Plant]:  # noqa: ARG001
    with Plant(tmp_path_factory.mktemp("living"), DEMO_LIFE) as running:
        running.live_first()
        running.start_daq()
        running.start_service()
        yield running
