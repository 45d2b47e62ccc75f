"""Rays through a binary BVH of our own (`binary`). Most modules are kernels, so none has the suffix `_kernels`."""
