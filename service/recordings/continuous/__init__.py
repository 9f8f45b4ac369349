"""All samples of a unit, kept one after the other as recordings in the data folder."""
