"""Adapters that read plant protocols and return :class:`core.samples.blocks.SampleBlock`."""
