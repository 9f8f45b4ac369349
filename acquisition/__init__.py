"""Adapters that convert data of plant protocols to :class:`core.samples.blocks.SampleBlock`."""
