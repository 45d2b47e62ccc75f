"""Decisions without rounding: sides of edges, ties, places of hits, bounds of float32's error, brute force."""
