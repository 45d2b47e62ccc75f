"""Rays and our own tree: nearest hits, whether there is any, and all hits, decided without rounding."""
