"""Float64 kernels that decide nothing by rounding: every ray against every triangle, and the place of each hit."""
