"""Commands beside sweeps: one point, one picture, the doctor, fetching scenes."""
