"""Alarms of a unit after ISA-18.2 / IEC 62682: kinds, rules, life cycle, operation, statistics.

Kinds of alarms about the service itself are the service's own.
"""
