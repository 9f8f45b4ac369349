"""Plant protocols on one side, :class:`core.samples.blocks.SampleBlock` on the other."""
