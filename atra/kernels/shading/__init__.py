"""Kernels of pictures: random numbers, surfaces, scattering, and the stages that hand rays and light on."""
