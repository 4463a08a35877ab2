"""Lines of `orders.txt`: what each channel does per turn of a shaft."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from specan.analysis.accumulator import feed
from specan.analysis.batch.result import FileResult
from specan.analysis.batch.settings import BatchSettings
from specan.analysis.order_settings import OrderSettings
from specan.analysis.quality import QualityPass
from specan.data.orders import OrderSpectrum
from specan.data.recording import Recording
from specan.errors import SpecanError
from specan.io import results_text as text
from specan.units import level_reference

TABLE = "orders.txt"
# Up to the highest order by default, every order is seen at every speed: one column says it all.
_NO_MAP = OrderSettings(columns=1)


def with_orders(found: FileResult, recording: Recording, settings: BatchSettings) -> FileResult:
    """The result with the orders of a recording that has a tacho, or for which the settings ask.

    Where there are none, `skipped.txt` says why. The samples are read once more: equal angles need the whole
    tacho first.
    """
    if found.kind != "done" or (settings.orders is None and not recording.by_role("tacho")):
        return found
    try:
        orders, words = _analyse(recording, settings.orders or _NO_MAP)
    except SpecanError as fault:
        reason = f"no orders: {str(fault).removeprefix(f'{recording.label}: ')}"
        return replace(found, blocks={**found.blocks, TABLE: ""}, set_aside=(*found.set_aside, ("", reason)))
    low, mean, high = orders.tacho.speed_hz
    source = f"by {orders.tacho.channel}" if orders.tacho.channel else "as stated"
    about = f"orders of a shaft at {mean:.6g} Hz ({low:.6g} to {high:.6g}) {source}, {orders.turns} turns"
    return replace(
        found,
        blocks={**found.blocks, TABLE: order_lines(orders, words)},
        about=(*found.about, about, *orders.notes),
    )


def _analyse(
    recording: Recording, settings: OrderSettings
) -> tuple[OrderSpectrum, Sequence[tuple[str, ...]]]:
    from specan.analysis.order_accumulator import OrderAccumulator

    accumulator = OrderAccumulator(recording, settings)
    look = QualityPass(accumulator)
    if settings.envelope_hz is None:
        feed(recording, [accumulator, look])
    else:
        feed(recording, [look])
        for samples in accumulator.pieces():
            accumulator.add(samples)
    return accumulator.result(), [quality.flags for quality in look.result()]


def order_lines(orders: OrderSpectrum, flags: Sequence[Sequence[str]]) -> str:
    """The orders that were asked for, with phase and uncertainty; without any, the lines of the spectrum."""
    blocks = []
    for row, (name, unit) in enumerate(zip(orders.channels, orders.units, strict=True)):
        lines = orders.lines
        order = orders.order[1:] if lines is None else lines.order
        amplitude = orders.amplitude[row, 1:] if lines is None else np.abs(lines.amplitude[row])
        with np.errstate(divide="ignore"):
            level = 20 * np.log10(amplitude / np.sqrt(2) / level_reference(unit).value)
        columns = {
            "file": orders.label,
            "channel": name,
            "unit": unit,
            "order": order,
            "amplitude": amplitude,
            "level_dB": level,
            "flags": " ".join(flags[row]),
        }
        if lines is not None:
            columns |= {
                "phase_deg": lines.phase_deg[row],
                "u": lines.u[row],
                "u_blocks": lines.u_scatter[row],
            }
        blocks.append(text.table_lines(columns, text.COLUMNS[TABLE]))
    return "".join(blocks)
