"""Meanings of the fields that have the same name and meaning in several API models.

A model states the meaning of a field only if it is not that of this table.
"""

from typing import Any

from service.settings import base

MEANINGS = {
    # places and names
    "id": "Identifier.",
    "name": "Name for display; null without a name.",
    "unit": "Identifier of the unit.",
    "bearing": "Identifier of the bearing; null if a unit as a whole is meant.",
    "label": "Description of the quantity in words.",
    "estimator": "Estimator of the stiffness; null if the film is not watched.",
    "clearance_um": "Radial clearance in operation, µm.",
    # persons and their entries
    "time": "Time to which the entry refers.",
    "number": "Number of the entry in its history, from 1 without gaps.",
    "role": "Role, which determines the permissions.",
    "created": "Time of creation.",
    "actor": "Person, API key or program that acted; empty if unknown.",
    "author": "Person, API key or program that made the entry.",
    "set": "Time when the reference was set.",
    "note": "Note of the author; null without a note.",
    "reason": "Reason given by the person or program that acted; may be empty.",
    # operating condition
    "operating_state": "Operating state of the unit; null without current data.",
    "is_settled": "Whether the operating state, and with it the warm-up, has lasted long enough to"
    " judge films; null without a state.",
    "speed_rpm": "Running speed, r/min; null if unknown.",
    "power_mw": "Active power, MW; null if unknown.",
    "eccentricity_ratio": "Eccentricity ratio: eccentricity divided by clearance; null if unknown.",
    "attitude_deg": "Attitude angle, degrees; null if unknown.",
    "oil_temperature_c": "Oil temperature, °C; null if unknown.",
    "cell": "Cell of the grid of operating conditions; null if a coordinate of it is unknown.",
    "eccentricity_low": "Lower bound of the eccentricity ratio.",
    "eccentricity_high": "Upper bound of the eccentricity ratio.",
    "oil_temperature_low_c": "Lower bound of the oil temperature, °C.",
    "oil_temperature_high_c": "Upper bound of the oil temperature, °C.",
    "attitude_low_deg": "Lower bound of the attitude angle, degrees; null if cells do not depend"
    " on it.",
    "attitude_high_deg": "Upper bound of the attitude angle, degrees; null if cells do not depend"
    " on it.",
    # samples and spectra
    "epoch": "Epoch of the sample index; it changes when the device restarts its count.",
    "first_index": "Index of the first sample.",
    "n_samples": "Number of samples per channel.",
    "start": "Time of the first sample.",
    "duration_s": "Time from the first to the last of these samples, s.",
    "rate_hz": "Sampling rate, Hz.",
    "received": "Arrival time of the newest of these samples by the clock of the service, from"
    " which their age counts; null for recorded samples, and without samples.",
    "rejected": "Number of rejected samples, by reason.",
    "frequency_hz": "Frequencies of the spectral lines, Hz.",
    # alarms
    "occurrence": "Number of the occurrence of the alarm.",
    "change": "Kind of alarm event.",
    # films and baselines
    "x": "Values in the direction x; null if the film is not watched, or without a baseline.",
    "y": "Values in the direction y; null if the film is not watched, or without a baseline.",
    "baseline_version": "Version of the baseline in force; null if no baseline is in force.",
    "stiffness_n_per_m": "Film stiffness, N/m; null if it could not be determined, and without a"
    " known bracket stiffness.",
    "stiffness_of_kb": "Film stiffness as a ratio to the bracket stiffness; null if the latter is"
    " known.",
    "why_not": "Reason why the film is not watched; null if it is watched.",
    "limits": "Alarm limits of the stiffness; null if the film is not watched.",
    "change_percent": "Most significant mean change of the stiffness, % of the expected stiffness;"
    " null if unknown.",
    "deviation_percent": "Deviation of the reading alone, % of the expected stiffness; null if it"
    " was not compared.",
    "ck_s": "Damping over stiffness, s; null if it could not be determined.",
    "ck_level": "Alarm level of damping over stiffness in force; null without a level.",
    "ck_change_percent": "Most significant mean change of damping over stiffness, %; null if"
    " unknown.",
    # answers
    "origin": "Origin of the data: live, or replay of a recording.",
    "low_95": "Lower end of the 95 % coverage interval.",
    "high_95": "Upper end of the 95 % coverage interval.",
    "n_found": "Number of entries in the range, also of those that the answer omits.",
    "next_before": "Value of the parameter ``before`` for the next page; null on the last page.",
    "simulated_until": "End of the simulated readings; null if there are none in the range.",
}
"""Descriptions of fields in JSON schemas, by name of the field."""


def describe_fields(schema: dict[str, Any], model: type[Any]) -> None:
    """Add the docstrings of fields, and the meanings of those without, to a model's JSON schema."""
    base.describe_fields(schema, model)
    for name, field in schema.get("properties", {}).items():
        if "$ref" not in field and name in MEANINGS:
            field.setdefault("description", MEANINGS[name])
