"""Whether a channel's calibration is good, doubtful or failed, and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from specan.analysis.insertion import Heard, Insertion
from specan.data.calibration import Verdict


@dataclass(frozen=True)
class Limit:
    """Up to `good` a figure passes, up to `doubtful` it is named, beyond that the channel has failed."""

    good: float
    doubtful: float
    text: str

    def judge(self, value: float) -> tuple[int, str]:
        """Severity 0, 1 or 2, and the sentence for the reader."""
        severity = int(abs(value) > self.good) + int(abs(value) > self.doubtful)
        return severity, self.text.format(value=value) if severity else ""


# Data sheets of array microphones allow 2 dB; a factor of two is another microphone, a wrong gain, or a
# microphone that is not seated. A good insertion scatters by 0.05 % and has a tone 40 dB above everything else.
LEVEL = Limit(2.0, 6.0, "{value:+.2f} dB from the nominal sensitivity")
NEIGHBOURS = Limit(
    3.0,
    6.0,
    "{value:+.2f} dB from the other microphones; a nominal sensitivity in the channel table would confirm it",
)
PURITY = Limit(0.03, 0.1, "noise and distortion are {value:.1%} of the tone")
SCATTER = Limit(0.5, 5.0, "the windows scatter by {value:.2f} %")
DRIFT = Limit(1.0, 5.0, "drifts by {value:+.2f} % during the recording")
REPEAT = Limit(0.2, 1.0, "insertions differ by {value:.2f} dB")
# Tolerances of single microphones mostly cancel in the middle of several.
TOGETHER_DB, TOGETHER = 1.5, 3
# From a quarter-inch microphone (1 mV/Pa) to a one-inch one (50 mV/Pa) with 10 dB of gain, and some room.
PLAUSIBLE_MV_PER_PA = (0.3, 300.0)
VERDICTS: tuple[Verdict, ...] = ("good", "doubtful", "failed")


def judge(
    heard: Sequence[tuple[Insertion, Heard]], mean: float, typical: float | None, doubt: str = ""
) -> tuple[Verdict, tuple[str, ...]]:
    """Level plausible, tone clean, stable: the worst insertion decides.

    Parameters
    ----------
    heard : sequence of (Insertion, Heard)
        Of one channel.
    mean : float
        Its sensitivity, mV/Pa.
    typical : float or None
        Middle of the sensitivities of all channels without a nominal one.
    doubt : str
        A sentence on its phase.
    """
    used = [h for _, h in heard if h.usable] or [h for _, h in heard]
    judged = [
        *_spoilt(heard, failed=not any(h.usable for _, h in heard)),
        PURITY.judge(max(h.impurity for h in used)),
        SCATTER.judge(max(h.scatter_percent for h in used)),
        DRIFT.judge(max((h.drift_percent for h in used), key=abs)),
        REPEAT.judge(_dB(max(h.sensitivity for h in used) / min(h.sensitivity for h in used))),
        *_level(heard, mean, typical),
        (int(bool(doubt)), doubt),
    ]
    worst = max(severity for severity, _ in judged)
    return VERDICTS[worst], tuple(dict.fromkeys(text for severity, text in judged if severity))


def _spoilt(heard: Sequence[tuple[Insertion, Heard]], failed: bool) -> list[tuple[int, str]]:
    """Clipping and drop-outs; a spoilt insertion is not used where another one is sound."""
    judged = []
    several = len(heard) > 1
    for insertion, h in heard:
        where = f" in {insertion.label}" if several else ""
        unused = "" if failed or h.usable else "; its sensitivity there is not used"
        if h.clipped:
            judged.append((2 if failed else 1, f"clipped{where}: rests on its largest value{unused}"))
        if h.missing:
            text = f"the tone is missing in {h.missing} of {h.missing + h.windows} windows{where}"
            judged.append((2 if failed and not h.usable else 1, text + (unused or ", which are left out")))
    return judged


def _level(
    heard: Sequence[tuple[Insertion, Heard]], mean: float, typical: float | None
) -> list[tuple[int, str]]:
    nominal = next((h.nominal for _, h in heard if h.nominal), None)
    if nominal is not None:
        return [LEVEL.judge(_dB(mean / nominal)), *[_together(i) for i, _ in heard]]
    judged = []
    if typical is not None:
        judged.append(NEIGHBOURS.judge(_dB(mean / typical)))
    low, high = PLAUSIBLE_MV_PER_PA
    if not low <= mean <= high:
        text = (
            f"{mean:.4g} mV/Pa is not a microphone's ({low:g} to {high:g}); is the calibrator's level right?"
        )
        judged.append((2, text))
    assumed = next((i for i, _ in heard if not i.level_confirmed), None)
    if assumed is not None:
        text = f"the calibrator's level of {assumed.level_dB:g} dB is assumed and no nominal sensitivity confirms it"
        judged.append((1, text))
    return judged


def _together(insertion: Insertion) -> tuple[int, str]:
    """Whether the microphones of an insertion are off their nominal sensitivities all together."""
    off = [_dB(h.sensitivity / h.nominal) for h in insertion.heard if h.nominal and h.usable]
    middle = float(np.median(off)) if len(off) >= TOGETHER else 0.0
    if abs(middle) <= TOGETHER_DB:
        return 0, ""
    return 1, (
        f"the microphones of {insertion.label} are {middle:+.1f} dB from their nominal sensitivities together: "
        f"is the calibrator's level {insertion.level_dB + middle:.0f} dB instead of {insertion.level_dB:g} dB?"
    )


def _dB(ratio: float) -> float:
    return float(20 * np.log10(ratio))
