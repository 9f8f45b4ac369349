"""padwatch's own recordings: a folder of manifest and Parquet, written and read back exactly."""
