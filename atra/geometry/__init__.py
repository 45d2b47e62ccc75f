"""Triangles, views and exact geometry: meshes and their files, cameras, ray space, sub-pixel positions."""
