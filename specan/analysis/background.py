"""Band levels corrected for a recording of the background."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from specan.arrays import Flags, Real
from specan.data.band_levels import BandLevels
from specan.errors import RequestError

# By how much a level has to exceed the background's to be corrected with confidence; ISO 3744:2010, 8.2.3.
STANDS_OUT_DB = 6.0


def background_correction(level_dB: Real, background_dB: Real) -> tuple[Real, Flags]:
    """Take the energy of the background off; where it is too loud for that, take off 1.26 dB and say so.

    K_1 = -10 lg(1 - 10^(-0.1 dL)) for dL = L - L_background of 6 dB or more; below that K_1 stays at its
    value for 6 dB, and the result is an upper bound: ISO 3744:2010, 8.2.3. (Above 15 dB the standard
    leaves the correction out; here it goes on, 0.14 dB and less.)

    Returns
    -------
    corrected, low_snr : ndarrays
        Levels in dB, and whether they stand out by less than 6 dB.

    Examples
    --------
    >>> corrected, low_snr = background_correction(np.array([70.0, 70.0]), np.array([60.0, 68.0]))
    >>> corrected.round(2).tolist(), low_snr.tolist()
    ([69.54, 68.74], [False, True])
    """
    with np.errstate(invalid="ignore"):
        margin = level_dB - background_dB
    margin = np.where(np.isneginf(background_dB), np.inf, margin)
    low_snr = ~(margin >= STANDS_OUT_DB) & ~np.isnan(level_dB)
    used = np.where(low_snr, STANDS_OUT_DB, margin)
    return level_dB + 10.0 * np.log10(1.0 - 10.0 ** (-0.1 * used)), low_snr


def without_background(levels: BandLevels, background: BandLevels) -> BandLevels:
    """Levels corrected for the background, channel by channel and band by band; overall levels as well.

    Bands and channels that stand out by less than 6 dB get the flag ``low-snr``.

    Raises
    ------
    RequestError
        The two were not analysed alike, or the background lacks a channel.
    """
    _check_alike(levels, background)
    rows = [_row(levels, row, background) for row in range(len(levels.channels))]

    def corrected(mine: Any, other: Any) -> tuple[dict[str, Any], Flags, Flags]:
        """Levels, which bands stand out too little, and which channels do in their overall levels."""
        level_dB, low = background_correction(mine.level_dB, other.level_dB[rows])
        found = [
            background_correction(values, other.overall_dB[n][rows]) for n, values in mine.overall_dB.items()
        ]
        overall = dict(zip(mine.overall_dB, (values for values, _ in found), strict=True))
        return (
            {"level_dB": level_dB, "overall_dB": overall},
            low,
            np.any([is_low for _, is_low in found], axis=0),
        )

    own, low_snr, low = corrected(levels, background)
    other = None
    if levels.other is not None and background.other is not None:
        other = replace(levels.other, **corrected(levels.other, background.other)[0])
    return replace(
        levels,
        **own,
        other=other,
        low_snr=low_snr,
        flags=tuple(
            (*words, "low-snr") if is_low and "low-snr" not in words else words
            for words, is_low in zip(levels.flags, low, strict=True)
        ),
        notes=(
            *levels.notes,
            f"corrected for the background {background.label}; low-snr: less than {STANDS_OUT_DB:g} dB above it, "
            "an upper bound (ISO 3744:2010, 8.2.3)",
        ),
    )


def _check_alike(levels: BandLevels, background: BandLevels) -> None:
    for name in ("fraction", "weighting", "averaging", "settling"):
        mine, other = getattr(levels, name), getattr(background, name)
        if mine != other:
            raise RequestError(f"{background.label} has the {name} {other}", expected=str(mine))
    if levels.averaging != "linear":
        raise RequestError(
            f"a background cannot be subtracted from levels with {levels.averaging} averaging",
            expected="linear averaging",
        )
    if not np.array_equal(levels.exact_hz, background.exact_hz):
        raise RequestError(
            f"{background.label} has other bands than {levels.label}",
            expected=f"bands from {levels.nominal_hz[0]:g} to {levels.nominal_hz[-1]:g} Hz",
        )


def _row(levels: BandLevels, row: int, background: BandLevels) -> int:
    """Where the background has the same channel."""
    wanted = levels.groups[row], levels.channels[row], levels.units[row]
    places = list(zip(background.groups, background.channels, background.units))
    if wanted in places:
        return places.index(wanted)
    # The group may be called otherwise in another recording.
    names = [(name.removeprefix(f"{group}/"), unit) for group, name, unit in places]
    alike = wanted[1].removeprefix(f"{wanted[0]}/"), wanted[2]
    if names.count(alike) == 1:
        return names.index(alike)
    raise RequestError(
        f"the background {background.label} has no channel {wanted[1]!r} in {wanted[2]}",
        expected=", ".join(background.channels),
        remedy="choose channels that both recordings have",
    )
