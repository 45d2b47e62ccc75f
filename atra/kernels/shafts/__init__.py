"""Kernels of ray classification: the shaft of a ray, and the nodes of a BVH that each shaft's rays may meet."""
