"""From calibrator recordings to a calibration: insertions joined, uncertainties, and a verdict per channel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from specan.analysis.insertion import CalibrationSettings, Heard, Insertion, evaluate_insertion
from specan.analysis.phase_chain import ChainedPhase, chain_phases, natural
from specan.data.calibration import Calibration, ChannelCalibration, Verdict
from specan.data.recording import PhaseCalibration, Recording
from specan.errors import InputError


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


# A microphone that is 3 dB off its data sheet is another microphone or a wrong gain; a good insertion
# scatters by 0.05 % and has a tone 40 dB above everything else.
LEVEL = Limit(3.0, 10.0, "{value:+.2f} dB from the nominal sensitivity")
PURITY = Limit(0.03, 0.3, "noise and distortion are {value:.1%} of the tone")
SCATTER = Limit(0.5, 5.0, "the windows scatter by {value:.2f} %")
DRIFT = Limit(1.0, 5.0, "drifts by {value:+.2f} % during the recording")
REPEAT = Limit(0.2, 1.0, "insertions differ by {value:.2f} dB")
PLAUSIBLE_MV_PER_PA = (0.3, 300.0)


def calibrate(recordings: Sequence[Recording], settings: CalibrationSettings | None = None) -> Calibration:
    """Sensitivity and phase of every microphone that stood in the calibrator.

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
    chained = [chain_phases([i for i in insertions if i.frequency_hz in tone]) for tone in tones]
    phases = {}
    notes: list[str] = []
    for channel in sorted({h.channel for i in insertions for h in i.heard}, key=natural):
        phases[channel], dropped = _phase(channel, tones, chained, settings)
        notes += dropped
    groups = sorted({phase.group for phase in phases.values()}, key=natural)
    if len(groups) > 1:
        notes.append(_separate(groups, phases))
    for insertion in insertions:
        notes += [f"{name} gives no signal in {insertion.label}: not calibrated" for name in insertion.silent]
    return Calibration(
        channels=tuple(_channel(name, insertions, phases[name], settings) for name in phases),
        made_from=tuple(insertion.label for insertion in insertions),
        calibrator_frequency_hz=_plain(float(np.mean(tones[0]))) if len(tones) == 1 else None,
        calibrator_level_dB=_only({insertion.level_dB for insertion in insertions}),
        notes=tuple(notes),
        source="calibrator recordings",
    )


def _tones(insertions: Sequence[Insertion]) -> list[list[float]]:
    """Frequencies of the insertions in clusters: a calibrator repeats its tone within 2 %."""
    clusters: list[list[float]] = []
    for frequency in sorted({insertion.frequency_hz for insertion in insertions}):
        if clusters and frequency <= clusters[-1][0] * 1.02:
            clusters[-1].append(frequency)
        else:
            clusters.append([frequency])
    return clusters


def _phase(
    channel: str,
    tones: Sequence[Sequence[float]],
    chained: Sequence[dict[str, ChainedPhase]],
    settings: CalibrationSettings,
) -> tuple[PhaseCalibration, list[str]]:
    """Phase at the tones that tie the channel to one and the same reference."""
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
    return calibration, dropped


def _separate(groups: Sequence[str], phases: dict[str, PhaseCalibration]) -> str:
    members = [[name for name, phase in phases.items() if phase.group == group] for group in groups]
    listed = "; ".join(f"{names[0]} ... {names[-1]}" if len(names) > 1 else names[0] for names in members)
    return (
        f"{len(groups)} groups share no microphone ({listed}): their phases are relative within each group "
        "only, and no phase between groups is known; to join them, calibrate again with one microphone in "
        "every insertion"
    )


def _channel(
    name: str, insertions: Sequence[Insertion], phase: PhaseCalibration, settings: CalibrationSettings
) -> ChannelCalibration:
    heard = [(i, h) for i in insertions for h in i.heard if h.channel == name]
    values = np.array([h.sensitivity for _, h in heard])
    mean = float(values.mean())
    within = [h.scatter_percent / np.sqrt(i.windows) for i, h in heard]
    between = 100 * float(values.std(ddof=1)) / mean / np.sqrt(len(values)) if len(values) > 1 else 0.0
    level = 100 * settings.u_level_dB * np.log(10) / 20
    verdict, reasons = _verdict([h for _, h in heard], mean)
    return ChannelCalibration(
        channel=name,
        sensitivity=_plain(mean),
        unit="mV/Pa",
        u_sensitivity_percent=_plain(
            float(np.sqrt(level**2 + np.mean(np.square(within)) / len(heard) + between**2))
        ),
        phase=phase,
        scatter_percent=_plain(max(h.scatter_percent for _, h in heard)),
        drift_percent=_plain(max((h.drift_percent for _, h in heard), key=abs)),
        verdict=verdict,
        reasons=reasons,
    )


def _verdict(heard: Sequence[Heard], mean: float) -> tuple[Verdict, tuple[str, ...]]:
    """Level plausible, tone clean, stable: the worst insertion decides."""
    judged = [
        PURITY.judge(max(h.impurity for h in heard)),
        SCATTER.judge(max(h.scatter_percent for h in heard)),
        DRIFT.judge(max((h.drift_percent for h in heard), key=abs)),
        REPEAT.judge(20 * np.log10(max(h.sensitivity for h in heard) / min(h.sensitivity for h in heard))),
    ]
    nominal = next((h.nominal for h in heard if h.nominal), None)
    if nominal is not None:
        judged.append(LEVEL.judge(20 * np.log10(mean / nominal)))
    elif not PLAUSIBLE_MV_PER_PA[0] <= mean <= PLAUSIBLE_MV_PER_PA[1]:
        judged.append((1, f"{mean:.4g} mV/Pa is unusual for a microphone"))
    if any(h.clipped for h in heard):
        judged.append((2, "clipped at the converter's range"))
    worst = max(severity for severity, _ in judged)
    verdicts: tuple[Verdict, ...] = ("good", "doubtful", "failed")
    return verdicts[worst], tuple(text for severity, text in judged if severity)


def _plain(value: float) -> float:
    """Rounded to what a calibration can be worth, so that its file reads well and is the same everywhere."""
    return round(value, 5) + 0.0


def _only(values: set[float]) -> float | None:
    return values.pop() if len(values) == 1 else None
