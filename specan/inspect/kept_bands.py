"""Power spectra that are kept: another fraction, weighting or range divides them anew, no sample is read."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from threading import Lock

import numpy as np

from specan.analysis.band_results import band_levels
from specan.analysis.octave import Octave
from specan.analysis.quality import BLOCK, QualityAccumulator
from specan.analysis.section import section, slow_part
from specan.data.band_levels import BandLevels
from specan.data.channel import Channel
from specan.data.levels import Quality
from specan.data.recording import Recording
from specan.dsp.band_energy import BandEnergyAccumulator, EnergySpectrum
from specan.dsp.record_edges import drift_spread
from specan.errors import RequestError

_Key = tuple[int, str, int, int, float]  # source, channel, section, and what is taken for a drift
_KEPT = 400  # one channel's spectrum takes some 0.2 MB


@dataclass(frozen=True)
class _Kept:
    spectrum: EnergySpectrum
    quality: Quality


class KeptBands:
    """Band levels of sections of recordings; the power spectrum of each channel and section is kept."""

    def __init__(self) -> None:
        self._kept: OrderedDict[_Key, _Kept] = OrderedDict()
        self._lock = Lock()

    def levels(self, recording: Recording, channels: tuple[Channel, ...], settings: Octave) -> BandLevels:
        """What `settings` gives for the channels (of one rate), with linear averaging.

        Channels that are no sound pressure are left out, with a note, where a weighting is asked for.
        """
        shown = [c for c in channels if settings.weighting == "Z" or c.target_unit == "Pa"]
        if not shown:
            raise RequestError(
                f"no channel on screen is a sound pressure in Pa, and {settings.weighting} is for those",
                remedy="choose microphones, or the Z weighting",
            )
        notes = [f"{c.label} is left out: {settings.weighting} is for Pa" for c in channels if c not in shown]
        start, stop = section(recording, shown, settings.start_s, settings.stop_s)
        # A drift is told apart from what bands hold.
        lowest = float(settings.bands(shown[0].sampling_rate).lower[0])
        spread = drift_spread(stop - start, shown[0].sampling_rate, lowest)
        keys = [(id(recording.source), c.path, start, stop, spread) for c in shown]
        lacking = {key: c for key, c in zip(keys, shown) if key not in self._kept}
        if lacking:
            self._read(recording, lacking, start, stop, lowest)
        kept = [self._kept[key] for key in keys]
        return band_levels(
            _joined([k.spectrum for k in kept]),
            shown,
            settings,
            label=recording.label,
            file_flags=recording.flags,
            quality=[k.quality for k in kept],
            notes=notes,
        )

    def _read(
        self, recording: Recording, lacking: Mapping[_Key, Channel], start: int, stop: int, lowest: float
    ) -> None:
        channels = list(lacking.values())
        slow = slow_part(recording, channels, start, stop, lowest)
        energy = BandEnergyAccumulator(
            len(channels),
            channels[0].sampling_rate,
            stop - start,
            slow,
            weighted=[c.target_unit == "Pa" for c in channels],
        )
        quality = QualityAccumulator(tuple(channels))
        with np.errstate(invalid="ignore", over="ignore"):  # a channel may hold NaN: its levels will be
            for samples in recording.blocks(channels, BLOCK, start, stop):
                energy.add(samples)
                quality.add(samples)
            whole = energy.result()
        with self._lock:
            for row, (key, seen) in enumerate(zip(lacking, quality.result())):
                one = replace(
                    whole,
                    nodes=whole.nodes[row : row + 1],
                    mean_square=whole.mean_square[row : row + 1],
                    mean=whole.mean[row : row + 1],
                    inner=None if whole.inner is None else whole.inner[row : row + 1],
                    cut={name: energy[row : row + 1] for name, energy in whole.cut.items()},
                )
                self._kept[key] = _Kept(one, seen)
            while len(self._kept) > max(_KEPT, len(channels)):
                self._kept.popitem(last=False)


def _joined(spectra: list[EnergySpectrum]) -> EnergySpectrum:
    return replace(
        spectra[0],
        nodes=np.concatenate([s.nodes for s in spectra]),
        mean_square=np.concatenate([s.mean_square for s in spectra]),
        mean=np.concatenate([s.mean for s in spectra]),
        inner=np.concatenate([s.between_ends().nodes for s in spectra]),
        cut={name: np.concatenate([s.cut[name] for s in spectra]) for name in spectra[0].cut},
    )
