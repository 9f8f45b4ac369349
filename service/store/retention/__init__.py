"""What is old is kept coarser: single readings, minutes, ten minutes; hours stay for ever."""
