"""Kernels of lightmaps: texels of charts, and the stages that batches of their rays go through."""
