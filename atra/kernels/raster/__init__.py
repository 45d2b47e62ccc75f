"""The rasteriser's kernels: vertices to pixels, triangles to bands of rows, bands to images."""
