"""What is not installed is said in one sentence, with the cure."""

import pytest

from acquisition.errors import ConfigError
from acquisition.extras import library


def test_a_library_that_is_not_installed_is_named_with_how_to_get_it() -> None:
    with pytest.raises(
        ConfigError, match=r"^XYZ needs absent_one: pip install 'padwatch\[imports\]'$"
    ):
        library("absent_one", "XYZ")
