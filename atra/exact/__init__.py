"""Exact decisions: sides of edges, ties, positions of hits, bounds of float32's error, brute force."""
