"""The motion of a shaft in its bearing, sample by sample: live, and out of recordings."""
