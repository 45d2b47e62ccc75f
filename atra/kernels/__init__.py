"""Numba: the loops over rays, the filter that keeps the nearest hit per cell, the plan. No configuration is read here.

Kernels release the GIL and take their work from a shared counter, so any number of Python threads can run one side by
side; they check nothing and allocate nothing per ray. Memory is addressed by integers, as Embree's C functions take it.
"""
