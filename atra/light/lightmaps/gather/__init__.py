"""The light that reaches texels: lights, probes, and the tables that kernels read."""
