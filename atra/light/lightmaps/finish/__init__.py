"""From lit texels to files: denoising, seams, gutters, export."""
