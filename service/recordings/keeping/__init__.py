"""The waveform store: which recordings there are, whether they are whole, how long they stay."""
