"""Peers: other people's ray tracers."""
