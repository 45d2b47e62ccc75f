"""Paths of light, wave by wave or one after the other."""
