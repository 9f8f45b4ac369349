"""Tables of films: readings with what was said of them, decisions, baselines and machine events."""

DIRECTION_COLUMNS = """
    ln_k_{d} REAL,
    u_random_{d} REAL,
    shaft_um_pk_{d} REAL,
    bearing_um_pk_{d} REAL,
    evidence_{d} INTEGER NOT NULL,
    reason_{d} TEXT NOT NULL,
    verdict_{d} INTEGER NOT NULL,
    level_{d} INTEGER CHECK (level_{d} IN (1, 2)),
    change_{d} REAL,
    change_std_{d} REAL,
    time_scale_h_{d} REAL,
    deviation_{d} REAL,
    deviation_std_{d} REAL,
    cause_{d} TEXT,
    cause_reason_{d} TEXT,
"""
"""Of a reading in one direction, as this schema has them; never edited once released."""

FILM_TABLES = f"""
    ALTER TABLE assessment ADD COLUMN operating_state INTEGER;
    ALTER TABLE assessment ADD COLUMN is_settled INTEGER;
    CREATE TABLE film_reading (
        series INTEGER NOT NULL REFERENCES series (id),
        estimator TEXT NOT NULL,
        time_ns INTEGER NOT NULL,
        provenance TEXT NOT NULL CHECK (provenance IN ('measured', 'simulated')),
        operating_state INTEGER NOT NULL,
        is_settled INTEGER NOT NULL CHECK (is_settled IN (0, 1)),
        speed_rpm REAL,
        power_mw REAL,
        eccentricity_ratio REAL,
        u_eccentricity REAL,
        attitude_deg REAL,
        oil_temperature_c REAL,
        {DIRECTION_COLUMNS.format(d="x")}
        {DIRECTION_COLUMNS.format(d="y")}
        baseline_version INTEGER,
        PRIMARY KEY (series, estimator, time_ns)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE simulated_past (
        series INTEGER PRIMARY KEY REFERENCES series (id),
        start_ns INTEGER NOT NULL,
        end_ns INTEGER NOT NULL
    ) STRICT;
    CREATE TABLE film_decision (
        series INTEGER NOT NULL REFERENCES series (id),
        direction TEXT NOT NULL CHECK (direction IN ('x', 'y')),
        estimator TEXT NOT NULL,
        baseline_version INTEGER,
        document TEXT NOT NULL,
        PRIMARY KEY (series, direction)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE baseline (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        unit TEXT NOT NULL,
        bearing TEXT NOT NULL,
        estimator TEXT NOT NULL,
        version INTEGER NOT NULL CHECK (version > 0),
        created_ns INTEGER NOT NULL,
        author TEXT NOT NULL,
        learned_from_ns INTEGER NOT NULL,
        learned_until_ns INTEGER NOT NULL,
        event TEXT NOT NULL,
        document TEXT NOT NULL,
        UNIQUE (unit, bearing, version)
    ) STRICT;
    CREATE TABLE baseline_step (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        unit TEXT NOT NULL,
        bearing TEXT NOT NULL,
        version INTEGER,
        step TEXT NOT NULL,
        time_ns INTEGER NOT NULL,
        from_ns INTEGER,
        actor TEXT NOT NULL,
        reason TEXT NOT NULL
    ) STRICT;
    CREATE INDEX baseline_step_of ON baseline_step (unit, bearing, id);
    CREATE TABLE shaft_response (
        unit TEXT PRIMARY KEY,
        created_ns INTEGER NOT NULL,
        document TEXT NOT NULL
    ) STRICT, WITHOUT ROWID;
    CREATE TRIGGER baseline_kept_as_learned BEFORE UPDATE ON baseline
    BEGIN SELECT RAISE(ABORT, 'baselines are kept as they were learned'); END;
    CREATE TRIGGER baseline_kept BEFORE DELETE ON baseline
    BEGIN SELECT RAISE(ABORT, 'baselines are kept'); END;
    CREATE TRIGGER baseline_step_kept_as_told BEFORE UPDATE ON baseline_step
    BEGIN SELECT RAISE(ABORT, 'what was done to baselines is kept as it was told'); END;
    CREATE TRIGGER baseline_step_kept BEFORE DELETE ON baseline_step
    BEGIN SELECT RAISE(ABORT, 'what was done to baselines is kept'); END;
"""
"""Statements of the migration that brings them."""
