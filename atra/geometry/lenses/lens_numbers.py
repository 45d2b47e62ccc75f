"""The numbers of a lens, as kernels take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

PERSPECTIVE, EQUIDISTANT, FIELD_OF_VIEW, EQUIRECTANGULAR = range(4)
"""How directions become places on a plane."""


class LensNumbers(NamedTuple):
    """A lens as kernels take it.

    kind: one of the four above. over, under: (5,) and (4,) float64, coefficients of the radial factor's numerator and
    denominator in powers of r^2. rise: (9,) float64, numerator of the derivative of r times that factor; its
    denominator is the square of the factor's. parts: (4, 13) float64, polynomials in r^2 that the determinant of the
    Jacobian is made of. p1, p2: tangential. s1, s2: thin prism along u in r^2 and r^4; s3, s4:
    along v. tilt, untilt: (3, 3) float64, homography of a tilted sensor and its inverse. is_radial: neither tangential
    nor prism. is_tilted: the sensor. omega: of `FIELD_OF_VIEW`. limit: largest r that is looked at. surely: r up to
    which no direction folds; for a radial lens the fold itself. farthest: upper limit of the distance from the axis to
    which anything before the fold is moved.
    """

    kind: int
    over: NDArray[np.float64]
    under: NDArray[np.float64]
    rise: NDArray[np.float64]
    parts: NDArray[np.float64]
    p1: float
    p2: float
    s1: float
    s2: float
    s3: float
    s4: float
    tilt: NDArray[np.float64]
    untilt: NDArray[np.float64]
    is_radial: bool
    is_tilted: bool
    omega: float
    limit: float
    surely: float
    farthest: float
