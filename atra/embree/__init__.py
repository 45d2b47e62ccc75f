"""The only room that knows Embree's C API: the library, its struct layouts, device and scene lifetimes, errors."""
