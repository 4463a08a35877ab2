"""Surface impedance and absorption of every wall in every third octave, and where the data do not tell.

From a fit of free admittances (`specan.room.wall_impedance.wall_admittance`) each wall has in each band an
admittance beta with a covariance. What is reported are functions of it - Z/(rho c) = 1/beta, absorption coefficients -
that bend too much for a linear rule where beta is small against its uncertainty. The interval of such a function g
is therefore the range of g over the profile-likelihood region

    {beta : Re(beta) >= 0,  d^2(beta) - min d^2 <= chi^2_1(0.95)},   d^2 = (beta - b)' C^-1 (beta - b),

with C the covariance after all other parameters have been refitted. It does not depend on which of Z, beta or
a coefficient one writes, becomes the delta rule where g is straight, and is open where Z has no upper end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from specan.arrays import Complex
from specan.dsp.bands import band_at, nominal_frequency
from specan.errors import RequestError, require_known
from specan.models.effect import ParameterName
from specan.result import Result, Sheet, counted, gathered, records
from specan.room.model.known_walls import diffuse_absorption, normal_absorption
from specan.room.wall_impedance.wall_admittance import WallFit, wall_fit
from specan.study.build_problem import assemble
from specan.study.observation import Array
from specan.study.study import Study

QUANTILE = 3.841458820694124  # chi-square, one degree of freedom, 95 %
ACCURACY = 0.1  # of an absorption coefficient: what counts as determined
ALL = "all"  # the name of the mean over the walls
_DIRECTIONS, _RADII = 720, 12


# what is reported of an admittance
FUNCTIONS: dict[str, Callable[[Complex], Array]] = {
    "resistance": lambda beta: np.real(1 / beta) + 0.0,  # no -0
    "reactance": lambda beta: np.imag(1 / beta),
    "magnitude": lambda beta: np.abs(1 / beta),
    "absorption_normal": normal_absorption,
    "absorption_diffuse": diffuse_absorption,
}


@dataclass(frozen=True, eq=False, repr=False)
class Impedance(Result):
    """All walls and bands of a room.

    Attributes
    ----------
    table : DataFrame
        One row for each wall and third octave, the mean over all walls (``all``), weighted by their areas, last:
        nominal and exact mid-band frequency, whether the band is determined, and the best admittance rho c / Z that a
        passive wall may have, with the standard error of its real part; of each of `FUNCTIONS` the value and the ends
        ``_low`` and ``_high`` of its 95 % interval, infinite where one is open. Z/(rho c) is that of exp(+j w t): a
        mass is positive.
    accuracy : float
        Of the criterion.
    fit : WallFit
    """

    table: pd.DataFrame
    accuracy: float
    fit: WallFit

    dimensions = ("wall", "third_octave_hz")

    def summary(self) -> str:
        """How many walls and bands, and how many of them the data determine."""
        known = self.table["determined"]
        return f"{counted(len(self.walls), 'wall')}, {known.sum()} of {len(known)} bands determined"

    def columns(self) -> dict[str, Any]:
        """One row for each wall and third octave, with the ends of the 95 % intervals."""
        found = self.table.drop(columns=["mid_hz", "admittance", "standard_error"])
        return {name: values.to_numpy() for name, values in found.items()}

    def content(self) -> dict[str, Any]:
        """What `to_dict` gives, with arrays in it."""
        ends = {"value": "", "low": "_low", "high": "_high"}
        rows = [
            {
                **{name: row[name] for name in (*self.dimensions, "determined")},
                "text": "" if row["determined"] else "not determined by these positions",
                **{name: {end: row[name + suffix] for end, suffix in ends.items()} for name in FUNCTIONS},
            }
            for row in records(**self.columns())
        ]
        about = {"criterion": self.criterion, "reduced_chi2": self.fit.reduced_chi2}
        return {"rows": rows, **about, "sentences": self.sentences()}

    def sheets(self) -> list[Sheet]:
        """A table of each wall, as the verb prints it."""
        header = ["Hz", "Re Z/(rho c)", "Im Z/(rho c)", "alpha, normal", "alpha, diffuse"]
        forms = {
            "resistance": ".3g",
            "reactance": ".3g",
            "absorption_normal": ".3f",
            "absorption_diffuse": ".2f",
        }
        found = []
        for wall, bands in self.table.groupby("wall", sort=False):
            rows = []
            for row in bands.to_dict("records"):
                cells = [
                    f"{row[n]:{f}} {row[n + '_low']:{f}}..{row[n + '_high']:{f}}" for n, f in forms.items()
                ]
                if not row["determined"]:
                    most = f"at most {row['absorption_normal_high']:.2f}"
                    cells = ["not determined", "by these positions", most, ""]
                rows.append([f"{row['third_octave_hz']:g}", *cells])
            title = "Mean over all walls, by area" if wall == ALL else f"Wall {wall}"
            found.append(Sheet(title, header, rows))
        return found

    @property
    def walls(self) -> tuple[str, ...]:
        """Names of the walls in `table`, without their mean."""
        return tuple(wall for wall in self.table["wall"].unique() if wall != ALL)

    @property
    def criterion(self) -> str:
        """What counts as determined, in words."""
        return (
            f"determined: alpha at normal incidence is known within +-{self.accuracy:g} at 95 % "
            "(1.96 x 4 x standard error of Re(rho c/Z))"
        )

    def of(self, wall: str) -> pd.DataFrame:
        """Bands of one wall."""
        return self.table[self.table["wall"] == wall]

    def only(self, wall: str) -> Impedance:
        """One wall.

        Raises
        ------
        RequestError
            There is none of that name.
        """
        require_known(wall, self.walls, f"the room has no wall {wall!r}")
        return Impedance(self.of(wall), self.accuracy, self.fit)

    def sentences(self) -> list[str]:
        """What stands out, in words: the softest wall, and where the data do not tell."""
        return [*_softest(self), *_not_told(self)]


def study_impedance(
    study: Study, accuracy: float = ACCURACY, progress: Callable[[str], None] | None = None
) -> Impedance:
    """Impedance and absorption of the walls of a room under study.

    What the study's model says of its walls plays no part; its other effects are fitted beside the walls.

    Raises
    ------
    RequestError
        The study is of no room, or rests on no recordings.
    ComputationError
        The fit does not converge.
    """
    if "wall_admittance" not in study.model.quantities:
        raise RequestError(
            f"the model of this study is {study.model.name}, which has no walls",
            expected="a study of a room",
            remedy="begin one with specan study new DIR --model room --rig RIG.toml --measurement RECORDING",
        )
    # not the study's own problem: its covariances are taken about a fit of the walls that the model has
    problem = assemble(study.model, study.content, study.data.fitted)
    walls = [u for u in problem.assembly.uses if "wall_admittance" in study.model.effects[u.name].changes]
    own = ("wall_admittance", *map(str, walls))
    others = [n for n in problem.free if n not in problem.priors and ParameterName(n).owner not in own]
    fit = wall_fit(problem, study.best.values if others else None, progress)
    lines = np.concatenate([o.conditions["frequency"] for o in problem.observations])
    wall_of_face = study.model.quantities["wall_of_face"]()
    summed = np.bincount(wall_of_face, study.model.settings["face_areas_m2"])
    areas = dict(zip(fit.walls, summed.tolist(), strict=True))
    return impedance(fit, areas, (float(lines.min()), float(lines.max())), accuracy)


def impedance(
    fit: WallFit, areas: Mapping[str, float], band: tuple[float, float], accuracy: float = ACCURACY
) -> Impedance:
    """Impedance and absorption from fitted admittances.

    Parameters
    ----------
    fit : WallFit
    areas : mapping
        Area of each wall, for their mean.
    band : tuple of float
        Lowest and highest line, Hz: third octaves whose middle lies outside are left out.
    accuracy : float
        Half-width of an absorption coefficient's interval that counts as determined.

    Raises
    ------
    RequestError
        An accuracy that cannot be.
    """
    if not 0 < accuracy <= 1:
        raise RequestError(f"an accuracy of {accuracy:g} is requested", expected="more than 0, at most 1")
    inside = [k for k, f in enumerate(fit.mid_hz) if band[0] <= f <= band[1]]
    area = np.array([areas[wall] for wall in fit.walls])
    shares = [*zip(fit.walls, np.eye(len(area)), strict=True), (ALL, area / area.sum())]
    rows = [
        _row(wall, fit.mid_hz[k], *fit.mean(share, k), accuracy) for wall, share in shares for k in inside
    ]
    return Impedance(pd.DataFrame(rows), accuracy, fit)


def _row(wall: str, mid_hz: float, beta: complex, covariance: Array, accuracy: float) -> dict[str, Any]:
    best, region, open_ended = _region(beta, covariance)
    error = float(np.sqrt(covariance[0, 0]))
    found = {
        "wall": wall, "third_octave_hz": nominal_frequency(band_at(mid_hz, 3), 3), "mid_hz": float(mid_hz),
        "determined": bool(1.96 * 4 * error <= accuracy), "admittance": best, "standard_error": error,
    }  # fmt: skip
    for name, function in FUNCTIONS.items():
        values = function(region)
        low, high = float(values.min()), float(values.max())
        if open_ended and name in ("resistance", "reactance", "magnitude"):
            low, high = {"resistance": 0.0, "reactance": -np.inf}.get(name, low), np.inf
        found |= {name: float(function(np.array([best]))[0]), f"{name}_low": low, f"{name}_high": high}
    return found


def _region(beta: complex, covariance: Array) -> tuple[complex, Complex, bool]:
    """Best passive admittance, points that fill the 95 % region about it, and whether 0 is one of them.

    Passive admittances near the edge are reached as points of the ellipse that are moved onto it.
    """
    root = np.linalg.cholesky(covariance)
    inverse = np.linalg.inv(covariance)

    def distance(points: Complex) -> Array:
        gap = np.stack([points.real - beta.real, points.imag - beta.imag])
        found: Array = np.einsum("in,ij,jn->n", gap, inverse, gap)
        return found

    best = beta
    if beta.real < 0:  # the nearest point of the edge Re = 0 in the metric of the covariance
        best = complex(0.0, beta.imag - covariance[0, 1] / covariance[0, 0] * beta.real)
    limit = float(distance(np.array([best]))[0]) + QUANTILE
    around = np.exp(2j * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS)
    disc = np.sqrt(limit) * np.outer(np.linspace(0, 1, _RADII + 1)[1:], around).ravel()
    points = beta + np.array([1, 1j]) @ root @ np.stack([disc.real, disc.imag])
    edge = 1j * np.linspace(points.imag.min(), points.imag.max(), _DIRECTIONS)
    points = np.concatenate([points[points.real >= 0], edge[distance(edge) <= limit], [best]])
    holds_zero = bool(distance(np.array([0j]))[0] <= limit)
    tiny = 1e-9  # a hard wall itself has no finite impedance
    return best, np.where(np.abs(points) < tiny, tiny, points), holds_zero


def _softest(found: Impedance) -> list[str]:
    """Where the surest absorption is."""
    sure = found.table[found.table["determined"] & (found.table["wall"] != ALL)]
    if sure.empty:
        return []
    peak = sure.loc[sure["absorption_normal_low"].idxmax()]
    others = sure[(sure["wall"] != peak["wall"]) & (sure["mid_hz"] == peak["mid_hz"])][
        "absorption_normal_high"
    ]
    rest = f"; every other wall at most {others.max():.3f} there" if others.size else ""
    return [
        "softest: wall {wall} at {third_octave_hz:g} Hz, absorbs {absorption_normal:.3f} ({absorption_normal_low:.3f} "
        "to {absorption_normal_high:.3f}) at normal incidence, |Z|/(rho c) = {magnitude:.3g} ({magnitude_low:.3g} to "
        "{magnitude_high:.3g})".format_map(peak)
        + rest
    ]


def _not_told(found: Impedance) -> list[str]:
    """Runs of bands that are not determined, walls with the same runs together."""
    open_ = found.table[~found.table["determined"] & (found.table["wall"] != ALL)]
    runs = gathered(
        (tuple(bands), wall) for wall, bands in open_.groupby("wall", sort=False)["third_octave_hz"]
    )
    return [
        f"not determined by these positions: wall{'s' * (len(walls) > 1)} {', '.join(walls)} at {_ranges(bands, found)}"
        for bands, walls in runs.items()
    ]


def _ranges(bands: tuple[float, ...], found: Impedance) -> str:
    """``25-80 Hz, 125 Hz`` for bands that follow each other."""
    order = found.table["third_octave_hz"].unique().tolist()
    apart = np.diff([order.index(band) for band in bands]) > 1
    runs = np.split(np.array(bands), np.flatnonzero(apart) + 1)
    return ", ".join(f"{r[0]:g}-{r[-1]:g} Hz" if len(r) > 1 else f"{r[0]:g} Hz" for r in runs)
