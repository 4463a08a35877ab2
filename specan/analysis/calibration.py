"""From calibrator recordings to a calibration: insertions joined, uncertainties, and a verdict per channel.

Decisions: docs/decisions/calibration.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from specan.analysis.calibration_verdict import (
    REPEAT,
    ChainedPhase,
    chain_phases,
    judge,
    natural,
    repeatability,
    sound,
    turned_over,
)
from specan.analysis.calibrator_tone import CalibrationSettings
from specan.analysis.insertion import Heard, Insertion, evaluate_insertion
from specan.data.calibration import Calibration, ChannelCalibration, Contribution
from specan.data.channel import PhaseCalibration
from specan.data.recording import Recording
from specan.errors import InputError


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


def join_insertions(
    insertions: Sequence[Insertion], settings: CalibrationSettings | None = None
) -> Calibration:
    """Join evaluated insertions; the order in which they come does not matter."""
    settings = settings or CalibrationSettings()
    insertions = sorted(insertions, key=lambda insertion: insertion.label)
    if not any(insertion.heard for insertion in insertions):
        raise InputError(
            "no channel of the calibrator recordings has a signal", expected="a calibrator's tone"
        )
    tones = _tones(insertions)
    # Without clipped channels: their harmonics, folded back by sampling, may fall on the tone.
    clean = [replace(i, heard=tuple(h for h in i.heard if not h.clipped)) for i in insertions]
    chained = [
        chain_phases([i for i in clean if i.frequency_hz in tone], settings.u_insertion_deg) for tone in tones
    ]
    names = sorted({h.channel for i in insertions for h in i.heard}, key=natural)
    phases: dict[str, PhaseCalibration] = {}
    parts: dict[str, list[ChainedPhase]] = {}
    doubts: dict[str, str] = {}
    notes: list[str] = []
    for channel in names:
        if any(channel in chain for chain in chained):
            phases[channel], parts[channel], dropped = _phase(channel, tones, chained, settings)
            notes += dropped
    groups = sorted({phase.group for phase in phases.values()}, key=natural)
    if len(groups) > 1:
        notes.append(_separate(groups, phases))
    notes += _left_out(insertions, set(names))
    for group in groups:
        _correct_polarity(group, phases, doubts)
    heard = {name: [(i, h) for i in insertions for h in i.heard if h.channel == name] for name in names}
    common, levels = _Common.of(heard, settings), {insertion.level_dB for insertion in insertions}
    return Calibration(
        channels=tuple(
            _channel(name, heard[name], common, phases.get(name), parts.get(name, ()), doubts.get(name, ""))
            for name in names
        ),
        made_from=tuple(insertion.label for insertion in insertions),
        calibrator_frequency_hz=_plain(float(np.mean(tones[0]))) if len(tones) == 1 else None,
        calibrator_level_dB=levels.pop() if len(levels) == 1 else None,
        u_calibrator_percent=_plain(common.u_level_percent),
        calibrator_decided=_decided(insertions),
        notes=tuple(notes),
        source="calibrator recordings",
    )


def _decided(insertions: Sequence[Insertion]) -> tuple[str, ...]:
    """How level and frequency of the calibrator were decided; a line for each way."""
    lines: dict[str, list[str]] = {}
    for i in insertions:
        lines.setdefault(f"level {i.level_dB:g} dB: {i.level_decided}", []).append(i.label)
    for i in insertions:
        lines.setdefault(f"tone near {i.frequency_hz:.0f} Hz: {i.frequency_decided}", []).append(i.label)
    return tuple(
        line + ("" if len(labels) == len(insertions) else f" ({', '.join(labels)})")
        for line, labels in lines.items()
    )


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


def _tones(insertions: Sequence[Insertion]) -> list[list[float]]:
    """Frequencies of the insertions in clusters: a calibrator repeats its tone within 2 %."""
    clusters: list[list[float]] = []
    for frequency in sorted({insertion.frequency_hz for insertion in insertions}):
        if not clusters or frequency > clusters[-1][0] * 1.02:
            clusters.append([])
        clusters[-1].append(frequency)
    return clusters


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
        f"the phase of {channel} at {f:.6g} Hz is left out: there it hangs on {phase.reference}, not on {reference}"
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


def _separate(groups: Sequence[str], phases: dict[str, PhaseCalibration]) -> str:
    members = [_members(group, phases) for group in groups]
    listed = "; ".join(f"{names[0]} ... {names[-1]}" if len(names) > 1 else names[0] for names in members)
    return (
        f"{len(groups)} groups share no microphone ({listed}): their phases are relative within each group "
        "only, and no phase between groups is known; to join them, calibrate again with one microphone in "
        "every insertion"
    )


def _members(group: str, phases: dict[str, PhaseCalibration]) -> list[str]:
    return [name for name, phase in phases.items() if phase.group == group]


def _correct_polarity(reference: str, phases: dict[str, PhaseCalibration], doubts: dict[str, str]) -> None:
    """Name inverted microphones of a group; their phase is corrected by 180 degrees at all frequencies.

    Where the reference itself is inverted, all phases are turned, so that those of the others are near zero.
    """
    group = _members(reference, phases)
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
