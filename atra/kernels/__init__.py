"""Kernels: the loops over rays and triangles, and the filter that keeps the nearest hit per cell, compiled by Numba.

Kernels release the GIL and take their work from a shared counter, so any number of Python threads can run one side by
side; they check nothing and allocate nothing per ray. Memory is addressed by integers, as Embree's C functions take it.
No configuration is read here.
"""
