"""What a signal is before any spectrum: its quality, and its single-number levels."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Quality:
    """What the samples of one channel say about their own usability.

    Attributes
    ----------
    n_samples : int
        Samples looked at.
    n_not_finite : int
        How many of them are NaN or infinite.
    minimum, maximum : float
        Extremes of the finite samples, in `unit`; NaN if there are none.
    clipped_low, clipped_high : bool
        Whether the signal rests on its lower or upper rail.
    flags : tuple of str
        ``dead`` (all samples equal), ``nan`` (some are not finite), ``clipped``.
    """

    channel: str
    unit: str
    n_samples: int
    n_not_finite: int
    minimum: float
    maximum: float
    clipped_low: bool
    clipped_high: bool

    @property
    def flags(self) -> tuple[str, ...]:
        """Words for the result tables, in alphabetical order."""
        words = {
            "clipped": self.clipped_low or self.clipped_high,
            "dead": self.n_not_finite == 0 and self.minimum == self.maximum,
            "nan": self.n_not_finite > 0,
        }
        return tuple(word for word, holds in words.items() if holds)
