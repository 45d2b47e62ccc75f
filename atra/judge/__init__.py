"""Images judged in float64: comparison pixel by pixel, reference, oracle, and which of tied triangles is named."""
