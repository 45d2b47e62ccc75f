"""Embree's C API, which no other room knows: the library, struct layouts, lifetimes of devices and scenes, errors."""
