"""What a recording may hold at most: the writer keeps to it, the reader refuses more unread."""

MAX_CHANNELS = 32
MAX_SLOW_CHANNELS = 50

ROWS_PER_GROUP = 131_072
"""Samples of each channel that are written and read at once: 1 MB for four channels."""

BLOCKS_PER_GROUP = 8192

MAX_BLOCK_SAMPLES = ROWS_PER_GROUP

MAX_SAMPLES = 2**29
"""Per channel: ten days at 600 Hz."""

MAX_INDEX = 2**53
"""Of a sample, and of an epoch; exact even where numbers are doubles."""

MAX_REJECTIONS = 32
"""Reasons for which samples before one block may have been refused."""

MAX_REASON_LENGTH = 64

MAX_MANIFEST_BYTES = 1_000_000

FOOTER_BYTES_PER_COLUMN = 512
"""Of a Parquet footer, for each column of each row group; a fourth of it is really needed."""
