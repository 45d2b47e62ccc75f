"""A small baker in waves: paths of many texels pass every stage together, in packets, with lanes packed or not.

It finds the light of `atra.light.Baker`, to the bit with single rays, and is measured for what the article on a
progressive lightmapper claims of compaction and expansion.
"""
