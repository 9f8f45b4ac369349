"""Pages of a plant with accounts whose DAQ does not answer."""
