"""Compiled code: how kernels are declared and kept, instruction sets, vectors, memory by address, threads.

Kernels are loops that Numba compiles. They release the GIL and take their work from a shared counter, so any number of
Python threads can run one side by side; they check nothing and allocate nothing per ray. Memory is addressed by
integers, as Embree's C functions take it. No configuration is read here.
"""
