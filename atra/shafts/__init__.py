"""Ray classification: rays sorted into shafts, each with a list of the nodes of a BVH that its rays may meet."""
