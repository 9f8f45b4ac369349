"""padwatch's own recordings (manifest and Parquet), and the files of other tools."""
