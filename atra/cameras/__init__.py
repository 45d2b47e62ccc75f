"""Cameras as other programs leave them: readers that return calibrated cameras by name, in the order of the file."""
