"""Geometry: meshes, cameras, image planes, ray space, splits and sub-pixel positions."""
