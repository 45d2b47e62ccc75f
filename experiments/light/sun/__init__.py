"""Aligned rays from texels to the sun: tiles of texels, and the triangles in front of each tile."""
