"""Alarms of a unit after ISA-18.2 / IEC 62682: kinds, rules, life cycle, operation, statistics.

The service layer defines the kinds of alarms about the service itself.
"""
