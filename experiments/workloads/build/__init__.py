"""Time to plan and to build the BVH."""
