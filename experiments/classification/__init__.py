"""Ray classification, a wing: our own BVH, shafts of rays with lists of its nodes, and what they gain in batches."""
