"""Alarms as values, after ISA-18.2 / IEC 62682: states, rules, and what leads on from each."""
