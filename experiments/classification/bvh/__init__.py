"""Rays through our own BVH (`atra.trees`). Most modules are kernels, so none has the suffix `_kernels`."""
