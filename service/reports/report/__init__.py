"""One page that tells of an occurrence of an alarm, to read or to print."""
