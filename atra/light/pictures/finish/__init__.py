"""From samples to a picture: error, stopping and resuming, layers, denoising, exposure and tone."""
