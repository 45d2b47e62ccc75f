"""Mesh files: how they become the triangles that are traced, whatever they hold."""
