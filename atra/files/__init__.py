"""Files: bounds on what reading one may cost, atomic writing, and saved images."""
