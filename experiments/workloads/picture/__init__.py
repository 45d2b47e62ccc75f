"""Shaded pictures of the hits and of where they differ."""
