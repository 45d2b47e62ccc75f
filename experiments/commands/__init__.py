"""Commands beside sweeps: one point, the doctor, fetching scenes."""
