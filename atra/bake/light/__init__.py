"""Light of a bake: lights, what rays are aimed at, and the tables that kernels read."""
