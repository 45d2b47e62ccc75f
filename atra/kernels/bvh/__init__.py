"""Kernels of our own binary BVH: built by threads, and traversed from any list of its nodes."""
