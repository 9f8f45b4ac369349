"""Rigs: each sample source on a counting plant, behind the same few handles."""
