"""Monitoring of one unit: assessments of its bearings from sample blocks."""
