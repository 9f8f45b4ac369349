"""Data shared by analysis and API: newest results and samples, alarm list, commands."""
