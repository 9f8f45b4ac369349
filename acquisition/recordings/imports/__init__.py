"""Import of measurement files of other tools: CSV, HDF5, TDMS, MDF 4 and CAN logs."""
