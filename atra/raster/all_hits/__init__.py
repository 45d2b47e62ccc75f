"""All hits by the rasteriser, and exact decisions about samples near an edge, for every method."""
