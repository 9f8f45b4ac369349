"""No two counts of a device share a number, whoever counted and however often it began."""

from hypothesis import given
from hypothesis import strategies as st

from acquisition.recordings.manifest import MAX_INDEX
from core.samples.axis import DEVICE_EPOCHS, Epochs

NS_PER_S = 1_000_000_000
BEGUN_NS = 1_767_225_600 * NS_PER_S

told = st.one_of(st.none(), st.integers(0, DEVICE_EPOCHS - 1))


def counts(begun_s: int, restarts: list[int | None], trusts_device: bool) -> list[int]:
    """Numbers of the counts of one life, whose device tells 7 at first."""
    epochs = Epochs(BEGUN_NS + begun_s * NS_PER_S, trusts_device=trusts_device)
    epochs.begin_first(7)
    found = [epochs.number]
    for restart in restarts:
        epochs.begin(restart)
        found.append(epochs.number)
    return found


@given(restarts=st.lists(told, max_size=20), later=st.lists(told, max_size=20))
def test_what_an_adapter_counts_itself_has_another_number_in_each_of_its_lives(restarts, later):
    first = counts(0, restarts, trusts_device=False)
    second = counts(30, later, trusts_device=False)
    assert len({*first, *second}) == len(restarts) + len(later) + 2


@given(restarts=st.lists(told, max_size=20), later=st.lists(told, max_size=20))
def test_what_a_trusted_device_tells_is_its_number_and_what_it_hides_has_one_of_its_own(
    restarts, later
):
    first = counts(0, restarts, trusts_device=True)
    second = counts(30, later, trusts_device=True)
    assert (first[0], second[0]) == (7, 7)
    shown = [*zip(restarts, first[1:], strict=True), *zip(later, second[1:], strict=True)]
    assert all(number == restart for restart, number in shown if restart is not None)
    hidden = [number for restart, number in shown if restart is None]
    assert len({*hidden}) == len(hidden)
    assert all(DEVICE_EPOCHS <= number < MAX_INDEX for number in hidden)


def test_an_epoch_that_is_wider_than_the_wire_still_changes_with_it():
    epochs = Epochs(BEGUN_NS, trusts_device=True)
    epochs.begin_first(-1)
    assert epochs.number == DEVICE_EPOCHS - 1
    epochs.begin(2**63 + 5)
    assert epochs.number == 5
