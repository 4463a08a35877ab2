"""Deep groove ball bearings: dimensions, load ratings, constants of the SKF friction model.

Bore and outside diameter are those of ISO 15; the static load rating C0 is the SKF catalogue's (publication
17000 EN, 2018, product table 1.1). C0 enters friction through an angle that goes with its power 0.24 only.
R1, R2, S1, S2: SKF, "The SKF model for calculating the frictional moment", table 3 (publication 10000 EN,
2013, pp. 97-112, unchanged in 17000 EN), in N and mm.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from specan.errors import RequestError, nearest

# designation: bore mm, outside diameter mm, static load rating kN
SIZES: dict[str, tuple[float, float, float]] = {
    "6000": (10, 26, 1.96), "6001": (12, 28, 2.36), "6002": (15, 32, 2.85), "6003": (17, 35, 3.25),
    "6004": (20, 42, 5.0), "6005": (25, 47, 6.55), "6006": (30, 55, 8.3), "6007": (35, 62, 10.2),
    "6008": (40, 68, 11.0), "6009": (45, 75, 14.6), "6010": (50, 80, 16.0), "6011": (55, 90, 21.2),
    "6012": (60, 95, 23.2),
    "6200": (10, 30, 2.36), "6201": (12, 32, 3.1), "6202": (15, 35, 3.75), "6203": (17, 40, 4.75),
    "6204": (20, 47, 6.55), "6205": (25, 52, 7.8), "6206": (30, 62, 11.2), "6207": (35, 72, 15.3),
    "6208": (40, 80, 19.0), "6209": (45, 85, 21.6), "6210": (50, 90, 23.2), "6211": (55, 100, 29.0),
    "6212": (60, 110, 36.0),
    "6300": (10, 35, 3.4), "6301": (12, 37, 4.15), "6302": (15, 42, 5.4), "6303": (17, 47, 6.55),
    "6304": (20, 52, 7.8), "6305": (25, 62, 11.6), "6306": (30, 72, 16.0), "6307": (35, 80, 19.0),
    "6308": (40, 90, 24.0), "6309": (45, 100, 31.5), "6310": (50, 110, 38.0), "6311": (55, 120, 45.0),
    "6312": (60, 130, 52.0),
}  # fmt: skip

# series: R1, R2, S1, S2
SERIES: dict[str, tuple[float, float, float, float]] = {
    "60": (4.1e-7, 1.7, 3.73e-3, 14.6),
    "62": (3.9e-7, 1.7, 3.23e-3, 36.5),
    "63": (3.7e-7, 1.7, 2.84e-3, 92.8),
}

K_Z = 3.1  # geometry constant of single row deep groove ball bearings (same source, table 4)

_CONTACT_SEAL = re.compile(r"RS|RSH|RSL|LLU|DDU", re.IGNORECASE)


@dataclass(frozen=True)
class BallBearing:
    """One deep groove ball bearing; lengths in mm and the rating in N, as the SKF formulas want them."""

    designation: str
    bore: float
    outside: float
    static_rating: float
    r1: float
    r2: float
    s1: float
    s2: float

    @property
    def mean_diameter(self) -> float:
        """Mean of bore and outside diameter, mm."""
        return 0.5 * (self.bore + self.outside)


def find(designation: str) -> BallBearing:
    """Look a bearing up; what follows the size (2Z, C3) does not change its constants.

    Raises
    ------
    RequestError
        The size is not in the table.

    Examples
    --------
    >>> find("6009 2Z C3").mean_diameter
    60.0
    """
    size = re.split(r"[\s\-/]", designation.strip(), maxsplit=1)[0]
    if size not in SIZES:
        raise RequestError(
            f"the bearing {designation!r} is not in the table of deep groove ball bearings",
            remedy=nearest(size, SIZES),
        )
    bore, outside, rating = SIZES[size]
    return BallBearing(size, bore, outside, 1e3 * rating, *SERIES[size[:2]])


def has_contact_seal(designation: str) -> bool:
    """Whether the suffix names a rubbing seal; a shield (Z, 2Z) does not rub.

    Examples
    --------
    >>> has_contact_seal("6009 2Z C3"), has_contact_seal("6009-2RSH")
    (False, True)
    """
    return bool(_CONTACT_SEAL.search(designation.strip()[4:]))
