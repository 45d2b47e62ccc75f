"""Scenes with materials and lights, made by code, for whole pictures."""
