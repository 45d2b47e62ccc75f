"""Where the rasteriser's time goes, stage by stage, and how far each stage is from what the machine can do."""
