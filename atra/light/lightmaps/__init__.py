"""Lightmaps: charts of a mesh, their texels, and the light that reaches each texel."""
