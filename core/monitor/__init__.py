"""Blocks of one unit in, assessments of its bearings out."""
