"""Bakes by paths that are followed one after the other."""
