"""Recordings as files for other tools: engineering units, UTC, gaps in sight."""
