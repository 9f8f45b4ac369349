"""Types of the fixtures that build what is written to a store, and what is asked of it."""

from collections.abc import Callable
from typing import Any

from core.assessment import Assessment
from service.store.port import TrendQuery, UnitGap

Build = Callable[..., Assessment]
BuildGap = Callable[..., UnitGap]
Ask = Callable[..., TrendQuery]
At = Callable[[int], int]
Execute = Callable[..., list[Any]]
