"""Why a block is not analysed."""


class BlockMisfitError(ValueError):
    """A block does not fit the unit: it has another rate or other channels, or is another's."""
