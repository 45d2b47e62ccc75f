"""Colours, dashes and sizes of every figure."""

# Okabe and Ito's palette, told apart by the colour-blind too; shapes and dashes say the same again.
BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILLION = "#333333", "#0072B2", "#009E73", "#E69F00", "#CC79A7", "#D55E00"
GREY, SKY = "#555555", "#56B4E9"
DASHED, DOTTED, DASH_DOTTED = (0, (6, 2)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5))

PARTS = tuple((color, hatch) for hatch in ("", "///") for color in (BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILLION))
"""Colour and hatching of the parts of a stacked bar."""

PANEL_INCHES = 3.3
"""Width of a panel with its margins: two of them are a paper's page."""
SMALL = 10.0
"""Size of the smallest text in points: 9 px where two panels are 428 px wide."""

TIMES = "\N{MULTIPLICATION SIGN}"
