"""Plant protocols on one side, :class:`core.blocks.SampleBlock` on the other."""
