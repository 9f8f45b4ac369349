"""Rows of readings, as files hold them, into histories: checked row by row, and nothing guessed."""

from core.baseline.history_rows.columns import REQUIRED, Columns, Place
from core.baseline.history_rows.names import Names
from core.baseline.history_rows.sorting import BearingRows, histories_from_columns

__all__ = ["REQUIRED", "BearingRows", "Columns", "Names", "Place", "histories_from_columns"]
