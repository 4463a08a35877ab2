"""From calibrator recordings to a calibration: insertions joined, uncertainties, and a verdict per channel.

Decisions: docs/decisions/calibration.md.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from specan.analysis.insertion import CalibrationSettings, Heard, Insertion, evaluate_insertion
from specan.data.calibration import VERDICTS, Calibration, ChannelCalibration, Contribution, Verdict
from specan.data.channel import PhaseCalibration
from specan.data.recording import Recording
from specan.dsp.welch import student_factor
from specan.errors import InputError
from specan.result import clustered, gathered


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
    used = sound(heard)
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


def sound(heard: Sequence[tuple[Insertion, Heard]]) -> list[Heard]:
    """The insertions of a channel whose sensitivity counts; all where none is sound."""
    return [h for _, h in heard if h.usable] or [h for _, h in heard]


def _spoilt(heard: Sequence[tuple[Insertion, Heard]], failed: bool) -> list[tuple[int, str]]:
    """Clipping and drop-outs; a spoilt insertion is not used where another one is sound."""
    judged = []
    several = len(heard) > 1
    for insertion, h in heard:
        where = f" in {insertion.label}" if several else ""
        unused = "" if failed or h.usable else "; its sensitivity there is not used"
        if h.clipped:
            judged.append((2 if failed else 1, f"clipped{where}: stays at its largest value{unused}"))
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
    assumed = next((i for i, _ in heard if not i.level.confirmed), None)
    if assumed is not None:
        text = f"the calibrator's level of {assumed.level.dB:g} dB is assumed and no nominal sensitivity confirms it"
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
        f"is the calibrator's level {insertion.level.dB + middle:.0f} dB instead of {insertion.level.dB:g} dB?"
    )


def _dB(ratio: float) -> float:
    return float(20 * np.log10(ratio))


@dataclass(frozen=True)
class ChainedPhase:
    """Phase relative to `reference`, the first channel of all that chains of shared microphones lead to.

    `u_phase_deg` has two parts: how well insertions repeat, with its degrees of freedom (None where it was
    declared), and the noise of the windows.
    """

    phase_deg: float
    u_insertion_deg: float
    u_windows_deg: float
    dof: int | None
    reference: str

    @property
    def u_phase_deg(self) -> float:
        """Standard uncertainty of the phase."""
        return float(np.hypot(self.u_insertion_deg, self.u_windows_deg))


def chain_phases(insertions: Sequence[Insertion], declared_deg: float = 0.0) -> dict[str, ChainedPhase]:
    r"""Phase of every channel at one tone, from insertions that may share microphones.

    Each insertion j gives :math:`\varphi_{cj} = \theta_c - o_j` with an unknown common phase
    :math:`o_j`. Where insertions share microphones the :math:`\theta_c` follow by least squares from all
    of them together, however long the chain; insertions that share none form separate groups. How well an
    insertion repeats follows from the residuals where there are enough of them, see `repeatability`, else it
    is `declared_deg`; both enter the uncertainty with the noise of the windows.

    Parameters
    ----------
    insertions : sequence of Insertion
        All at one tone.
    declared_deg : float
        Standard uncertainty by which the phase between two microphones changes from one insertion to the
        next; each of the two has half of the variance.

    Returns
    -------
    dict
        Channel name to its phase; the reference itself has 0 +- 0.
    """
    found: dict[str, ChainedPhase] = {}
    waiting = [insertion for insertion in insertions if insertion.heard]
    while waiting:
        group, rough = [], dict[str, float]()
        tied: Insertion | None = waiting[0]
        while tied is not None:
            waiting.remove(tied)
            group.append(tied)
            tie = next((h for h in tied.heard if h.channel in rough), tied.heard[0])
            for h in tied.heard:
                rough.setdefault(h.channel, rough.get(tie.channel, 0.0) + h.phase_deg - tie.phase_deg)
            tied = next((i for i in waiting if any(h.channel in rough for h in i.heard)), None)
        found |= _adjust(group, rough, declared_deg)
    return found


def _adjust(
    insertions: Sequence[Insertion], rough: dict[str, float], declared_deg: float
) -> dict[str, ChainedPhase]:
    """Least squares over one connected group about rough phases; the reference is its first channel as people count."""
    reference = min(rough, key=natural)
    rough = {name: phase - rough[reference] for name, phase in rough.items()}
    unknown = [name for name in rough if name != reference]
    columns = {name: i for i, name in enumerate(unknown)}
    seen = [(j, h) for j, insertion in enumerate(insertions) for h in insertion.heard]
    design = np.zeros((len(seen), len(unknown) + len(insertions)))
    observed = np.zeros(len(seen))
    offsets = [rough[i.heard[0].channel] - i.heard[0].phase_deg for i in insertions]
    for row, (j, h) in enumerate(seen):
        if h.channel != reference:
            design[row, columns[h.channel]] = 1.0
        design[row, len(unknown) + j] = -1.0
        # Small differences from the rough values, so that no angle wraps.
        observed[row] = _wrap(h.phase_deg - rough[h.channel] + offsets[j])
    solve = np.linalg.pinv(design)
    correction = solve @ observed
    residual = observed - design @ correction
    windows = np.array([h.u_phase_deg**2 for _, h in seen])
    u, dof = repeatability(
        float(residual @ residual),
        len(seen) - design.shape[1],
        float(windows.mean()),
        declared_deg / np.sqrt(2),
    )
    found = {reference: ChainedPhase(0.0, 0.0, 0.0, dof, reference)}
    for name, i in columns.items():
        weights = solve[i] ** 2
        phase = float(_wrap(rough[name] + correction[i]))
        inserted, noise = u * np.sqrt(weights.sum()), np.sqrt(weights @ windows)
        found[name] = ChainedPhase(phase, float(inserted), float(noise), dof, reference)
    return found


def natural(name: str) -> list[tuple[int, int | str]]:
    """Sorting key under which "Mic 2" stands before "Mic 10"."""
    return [(0, int(part)) if part.isdigit() else (1, part) for part in re.split(r"(\d+)", name) if part]


def _wrap(degrees: float) -> float:
    return float((degrees + 180.0) % 360.0 - 180.0)


# Channels of one make differ by some degrees at 1 kHz; one that is turned differs by 180 degrees.
TOLERANCE_DEG = 30.0


def turned_over(phases: Mapping[str, Sequence[float]]) -> tuple[set[str], set[str]]:
    """Channels of inverted polarity, and those whose phase is neither that of a matched nor of a turned one.

    Phases at all tones must be within 30 degrees of 180: a delay would turn with frequency. The larger part
    of the group is taken for right; between equal parts the one that holds the reference.

    Parameters
    ----------
    phases : mapping of str to sequence of float
        Phases in degrees at one or more tones, of all channels of one group, relative to its first channel.

    Examples
    --------
    >>> turned_over({"Mic 1": [0.0], "Mic 2": [-174.5], "Mic 3": [2.0]})
    ({'Mic 2'}, set())
    >>> turned_over({"Mic 1": [0.0], "Mic 2": [-174.5], "Mic 3": [177.0]})
    ({'Mic 1'}, set())
    """
    like, opposite = set[str](), set[str]()
    for name, degrees in phases.items():
        if all(abs(_wrap(d)) <= TOLERANCE_DEG for d in degrees):
            like.add(name)
        elif all(abs(_wrap(d)) >= 180.0 - TOLERANCE_DEG for d in degrees):
            opposite.add(name)
    return (like if len(opposite) > len(like) else opposite), set(phases) - like - opposite


ENOUGH = 3  # degrees of freedom from which an estimate replaces what was declared


def repeatability(squares: float, dof: int, windows: float, declared: float) -> tuple[float, int | None]:
    r"""Standard uncertainty of one observation by its insertion, and its degrees of freedom.

    The residuals of observations that were made more than once have the variance
    :math:`s^2 = \sum r^2 / \nu`, of which the noise within the insertions is a part. With three degrees of
    freedom or more the rest is the estimate (GUM type A), times :math:`t_{0.975}(\nu) / 1.96`: then
    +-1.96 u holds 95 % although s is itself uncertain (GUM, annex G). With fewer, the declared value counts
    (type B), or the estimate where that is larger.

    Parameters
    ----------
    squares : float
        Sum of squared residuals.
    dof : int
        Observations minus unknowns.
    windows : float
        Mean variance of an observation by the noise of its windows.
    declared : float
        Standard uncertainty that is stated for one observation.

    Returns
    -------
    tuple
        The uncertainty in the unit of the residuals; degrees of freedom, None for type B.

    Examples
    --------
    >>> found, freedom = repeatability(0.04, 4, 0.0, 0.5)
    >>> round(found, 4), freedom
    (0.1417, 4)
    >>> repeatability(0.0, 0, 0.0, 0.5)
    (0.5, None)
    """
    found = math.sqrt(max(squares / dof - windows, 0.0)) if dof > 0 else 0.0
    if dof < ENOUGH:
        return max(found, declared), None
    return found * float(student_factor(dof)), dof


def calibrate(recordings: Sequence[Recording], settings: CalibrationSettings | None = None) -> Calibration:
    """Sensitivity and phase of every microphone that was in the calibrator.

    Parameters
    ----------
    recordings : sequence of Recording
        Recordings of a calibrator, opened without a calibration. Insertions that share a microphone are
        chained in phase through it; several tones may be among them.
    settings : CalibrationSettings

    Returns
    -------
    Calibration
        Channels in natural order. `notes` says which phase groups cannot be compared.

    Raises
    ------
    InputError
        A recording is none of a calibrator.
    """
    settings = settings or CalibrationSettings()
    return join_insertions([evaluate_insertion(r, settings) for r in recordings], settings)


def join_insertions(insertions: Sequence[Insertion], settings: CalibrationSettings) -> Calibration:
    """Join evaluated insertions; the order in which they come does not matter."""
    insertions = sorted(insertions, key=lambda insertion: insertion.label)
    if not any(insertion.heard for insertion in insertions):
        raise InputError(
            "no channel of the calibrator recordings has a signal", expected="a calibrator's tone"
        )
    # A calibrator repeats its tone within 2 %.
    tones = clustered({insertion.frequency_hz for insertion in insertions}, float, 0.02)
    # Without clipped channels: their harmonics, folded back by sampling, may fall on the tone.
    phases, parts, doubts, notes = _phases(insertions, tones, settings)
    names = sorted({h.channel for i in insertions for h in i.heard}, key=natural)
    notes += _left_out(insertions, set(names))
    heard = {name: [(i, h) for i in insertions for h in i.heard if h.channel == name] for name in names}
    decided = gathered(
        [
            *((f"level {i.level.dB:g} dB: {i.level.decided}", i.label) for i in insertions),
            *((f"tone near {i.frequency_hz:.0f} Hz: {i.frequency_decided}", i.label) for i in insertions),
        ]
    )
    common, levels = _Common.of(heard, settings), {insertion.level.dB for insertion in insertions}
    return Calibration(
        channels=tuple(
            _channel(name, heard[name], common, phases.get(name), parts.get(name, ()), doubts.get(name, ""))
            for name in names
        ),
        made_from=tuple(insertion.label for insertion in insertions),
        calibrator_frequency_hz=_plain(float(np.mean(tones[0]))) if len(tones) == 1 else None,
        calibrator_level_dB=levels.pop() if len(levels) == 1 else None,
        u_calibrator_percent=_plain(common.u_level_percent),
        calibrator_decided=tuple(
            line + ("" if len(labels) == len(insertions) else f" ({', '.join(labels)})")
            for line, labels in decided.items()
        ),
        notes=tuple(notes),
        source="calibrator recordings",
    )


def _phases(
    insertions: Sequence[Insertion], tones: Sequence[Sequence[float]], settings: CalibrationSettings
) -> tuple[dict[str, PhaseCalibration], dict[str, list[ChainedPhase]], dict[str, str], list[str]]:
    """Phases of the channels, what each is chained of, doubts about channels, and notes."""
    clean = [replace(i, heard=tuple(h for h in i.heard if not h.clipped)) for i in insertions]
    chained = [
        chain_phases([i for i in clean if i.frequency_hz in tone], settings.u_insertion_deg) for tone in tones
    ]
    phases: dict[str, PhaseCalibration] = {}
    parts: dict[str, list[ChainedPhase]] = {}
    doubts: dict[str, str] = {}
    notes: list[str] = []
    for channel in sorted(set().union(*chained), key=natural):
        phases[channel], parts[channel], dropped = _phase(channel, tones, chained, settings)
        notes += dropped
    members = gathered((phase.group, name) for name, phase in phases.items())
    groups = [members[group] for group in sorted(members, key=natural)]
    if len(groups) > 1:
        listed = "; ".join(f"{names[0]} ... {names[-1]}" if len(names) > 1 else names[0] for names in groups)
        notes.append(
            f"{len(groups)} groups share no microphone ({listed}): their phases are relative within each group "
            "only, and no phase between groups is known; to join them, calibrate again with one microphone in "
            "every insertion"
        )
    for group in groups:
        _correct_polarity(group, phases, doubts)
    return phases, parts, doubts, notes


def _left_out(insertions: Sequence[Insertion], calibrated: set[str]) -> list[str]:
    """Sentences on channels that should have heard a tone, or heard one and are in no calibration."""
    notes = []
    for insertion in insertions:
        for left in insertion.left_out:
            if left.channel not in calibrated:
                notes.append(f"{left.channel} {left.why} in {insertion.label}: not calibrated")
            elif left.named:
                notes.append(
                    f"{left.channel} {left.why} in {insertion.label}: calibrated from other insertions"
                )
    return notes


def _phase(
    channel: str,
    tones: Sequence[Sequence[float]],
    chained: Sequence[dict[str, ChainedPhase]],
    settings: CalibrationSettings,
) -> tuple[PhaseCalibration, list[ChainedPhase], list[str]]:
    """Phase at the tones that tie the channel to one and the same reference, what it is of, and what is left out."""
    found = [
        (
            float(np.mean(tone)),
            chain[channel],
            sum(p.reference == chain[channel].reference for p in chain.values()),
        )
        for tone, chain in zip(tones, chained, strict=True)
        if channel in chain
    ]
    reference = max(found, key=lambda entry: entry[2])[1].reference
    kept = [(f, phase) for f, phase, _ in found if phase.reference == reference]
    dropped = [
        f"the phase of {channel} at {f:.6g} Hz is left out: it is relative to {phase.reference}, not to {reference}"
        for f, phase, _ in found
        if phase.reference != reference
    ]
    calibration = PhaseCalibration(
        frequency_hz=tuple(_plain(f) for f, _ in kept),
        phase_deg=tuple(_plain(phase.phase_deg) for _, phase in kept),
        u_phase_deg=tuple(_plain(phase.u_phase_deg) for _, phase in kept),
        model=settings.phase_model,
        group=reference,
    )
    return calibration, [phase for _, phase in kept], dropped


def _correct_polarity(
    group: Sequence[str], phases: dict[str, PhaseCalibration], doubts: dict[str, str]
) -> None:
    """Name inverted microphones of a group; their phase is corrected by 180 degrees at all frequencies.

    Where the reference itself is inverted, all phases are turned, so that those of the others are near zero.
    """
    reference = phases[group[0]].group
    inverted, unclear = turned_over({name: phases[name].phase_deg for name in group})
    for name in group:
        degrees = phases[name].phase_deg
        if reference in inverted:
            degrees = tuple(_plain(d % 360.0 - 180.0) for d in degrees)
        phases[name] = replace(phases[name], phase_deg=degrees, inverted=name in inverted)
        if name in inverted:
            doubts[name] = "polarity inverted: 180 degrees are corrected at all frequencies"
        elif name in unclear:
            told = " / ".join(f"{d:.0f}" for d in degrees)
            doubts[name] = (
                f"a phase of {told} degrees is that of neither a matched nor an inverted microphone"
            )


@dataclass(frozen=True)
class _Common:
    """What the channels of a calibration share: level, repeatability of insertions, usual sensitivity."""

    u_level_percent: float
    u_insertion_percent: float
    dof: int | None
    typical: float | None

    @classmethod
    def of(cls, heard: dict[str, list[tuple[Insertion, Heard]]], settings: CalibrationSettings) -> _Common:
        """From the sensitivities of all channels, those that were inserted more than once first."""
        squares, dof, windows = 0.0, 0, []
        for found in heard.values():
            used = sound(found)
            values = np.log([h.sensitivity for h in used])
            squares += float(np.sum((100 * (values - values.mean())) ** 2))
            dof += len(used) - 1
            windows += [h.scatter_percent**2 / h.windows for h in used] if len(used) > 1 else []
        u, dof_of_u = repeatability(
            squares, dof, float(np.mean(windows or [0.0])), _percent(settings.u_insertion_dB)
        )
        alone = [
            np.mean([h.sensitivity for h in sound(found)])
            for found in heard.values()
            if not any(h.nominal for _, h in found)
        ]
        return cls(
            _percent(settings.u_level_dB),
            u,
            dof_of_u,
            float(np.exp(np.median(np.log(alone)))) if len(alone) > 1 else None,
        )


def _channel(
    name: str,
    heard: Sequence[tuple[Insertion, Heard]],
    common: _Common,
    phase: PhaseCalibration | None,
    parts: Sequence[ChainedPhase],
    doubt: str,
) -> ChannelCalibration:
    used = sound(heard)
    values = np.array([h.sensitivity for h in used])
    mean, n = float(values.mean()), len(used)
    within = float(np.sqrt(np.sum([h.scatter_percent**2 / h.windows for h in used]))) / n
    between, dof = common.u_insertion_percent, common.dof
    if REPEAT.judge(20 * np.log10(values.max() / values.min()))[0]:
        own = 100 * float(values.std(ddof=1)) / mean  # it repeats worse than the others
        between, dof = (own, n - 1) if own > between else (between, dof)
    verdict, reasons = judge(heard, mean, common.typical, doubt)
    budget = [
        Contribution("sensitivity", "calibrator level", "B", common.u_level_percent, "%", None),
        Contribution("sensitivity", "insertion", "A" if dof else "B", between / np.sqrt(n), "%", dof),
        Contribution("sensitivity", "windows", "A", within, "%", sum(h.windows - 1 for h in used)),
    ]
    for f, part in zip(phase.frequency_hz, parts, strict=True) if phase else ():
        of = f"phase at {f:.6g} Hz"
        budget += [
            Contribution(of, "insertion", "A" if part.dof else "B", part.u_insertion_deg, "deg", part.dof),
            Contribution(of, "windows", "A", part.u_windows_deg, "deg", sum(h.windows - 1 for h in used)),
        ]
    return ChannelCalibration(
        channel=name,
        sensitivity=float(f"{mean:.7g}"),  # never zero, however faint the channel
        unit="mV/Pa",
        u_sensitivity_percent=_plain(float(np.sqrt(sum(c.u**2 for c in budget if c.of == "sensitivity")))),
        phase=phase,
        scatter_percent=_plain(max(h.scatter_percent for h in used)),
        drift_percent=_plain(max((h.drift_percent for h in used), key=abs)),
        verdict=verdict,
        reasons=reasons,
        budget=tuple(budget),
    )


def _percent(dB: float) -> float:
    """A small level difference in percent of the amplitude."""
    return 100 * dB * float(np.log(10)) / 20


def _plain(value: float) -> float:
    """Rounded to what a calibration can be worth, so that its file reads well and is the same everywhere."""
    return round(value, 5) + 0.0
