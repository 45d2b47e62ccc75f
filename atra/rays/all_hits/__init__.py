"""All hits of rays of no camera: finding them without rounding, lists, reductions, and what lies inside."""
