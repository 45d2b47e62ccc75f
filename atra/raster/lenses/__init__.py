"""The rasteriser for cameras with a lens."""
