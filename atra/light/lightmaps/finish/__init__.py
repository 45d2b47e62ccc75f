"""Finishing: what lit texels go through before they are a file: denoising, seams, gutters."""
