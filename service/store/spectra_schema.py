"""The table of spectra over time."""

SPECTRA_TABLES = """
    CREATE TABLE spectrum (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        series INTEGER NOT NULL REFERENCES series (id),
        tier INTEGER NOT NULL CHECK (tier IN (0, 1)),
        slot INTEGER NOT NULL,
        time_ns INTEGER NOT NULL,
        duration_s REAL NOT NULL,
        n_segments INTEGER NOT NULL,
        operating_state INTEGER NOT NULL,
        quality_level INTEGER NOT NULL,
        quality_reason TEXT NOT NULL,
        speed_rpm REAL,
        power_mw REAL,
        order1_hz REAL,
        vortex_hz REAL,
        bin_hz REAL NOT NULL CHECK (bin_hz > 0),
        amplitudes BLOB NOT NULL,
        checksum BLOB NOT NULL,
        UNIQUE (series, tier, slot)
    ) STRICT;
    CREATE INDEX spectrum_at ON spectrum (series, time_ns);
    CREATE INDEX spectrum_of ON spectrum (series, tier);
"""
"""Statements of the migration that brings them."""
