"""Compiled code: kernels and their cache, instruction sets, vectors, memory by address, threads.

Kernels are loops that Numba compiles. They release the GIL and take work from a shared counter, so any number of Python
threads can run one together. They check nothing and allocate nothing per ray. Memory addresses are integers.
"""
