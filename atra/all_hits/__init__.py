"""All hits of a ray: what can be made of them, and the results, whoever finds the hits."""
