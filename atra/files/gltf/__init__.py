"""Geometry from glTF and GLB."""
