"""Tables and short texts of a study, for the screen, the report and the page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from specan.result import Sheet, cell
from specan.study.estimation.prediction_error import ObservableError
from specan.study.history import Step, error_pairs
from specan.study.localisation.by_band_and_channel import FrfErrors
from specan.study.localisation.localise import Block
from specan.study.verdict import Diagnosis, Pull, percent, placed
from specan.units import printed_unit, spoken

if TYPE_CHECKING:
    from specan.study.study import Study

SEPARATES = 2.0  # sigma by which a reading has to separate explanations to tell them apart


def errors(found: Iterable[ObservableError], title: str = "", data: Sequence[str] = ()) -> Sheet:
    """Errors of every observable; `data` names the data of each row, where there are several kinds."""
    header = ["observable", "values", "RMS error", "bias", "unit", "relative RMS", "largest"]
    rows: list[list[Any]] = [
        [
            e.observable, e.n, spoken(e.rms, digits=4),
            f"{float(spoken(e.bias, digits=2)) if abs(e.bias) > 1e-9 * e.rms else 0.0:+g}",
            printed_unit(e.unit), f"{e.relative_rms:.2f} %", f"{e.relative_max:.2f} %",
        ]
        for e in found
    ]  # fmt: skip
    if not data:
        return Sheet(title, header, rows)
    return Sheet(title, ["data", *header], [[kind, *row] for kind, row in zip(data, rows, strict=True)])


def parameters(found: Mapping[str, Mapping[str, Any]]) -> Sheet:
    """Fitted parameters with their 95 % intervals."""
    rows = [[name, *_interval(p, 4), printed_unit(p["unit"]), _remark(p)] for name, p in found.items()]
    return Sheet("Parameters (95 %)", ["parameter", "value", "from", "to", "unit", ""], rows)


def _interval(p: Mapping[str, Any], least: int) -> list[str]:
    """A value and the ends of its interval, to a thousandth of it, with as many digits as tell the ends apart."""
    step = (p["high"] - p["low"]) / 1000
    places = -int(np.floor(np.log10(step))) if 0 < step < np.inf else 300
    values = [round(p[key], places) + 0.0 for key in ("value", "low", "high")]
    texts = ([spoken(value, digits=digits) for value in values] for digits in range(least, 9))
    return next((found for found in texts if found[1] != found[2]), [spoken(v, digits=least) for v in values])


def _remark(p: Mapping[str, Any]) -> str:
    if p["at_bound"]:
        return "at its bound"
    if not p["plausible"]:
        return "outside known range"
    return "certificate" if p.get("nuisance") else ""


def value_text(p: Mapping[str, Any]) -> str:
    """``9.37 (7.02 to 11.6) W``."""
    value, low, high = _interval(p, 3)
    return f"{value} ({low} to {high}) {printed_unit(p['unit'])}".rstrip()


def amount(error: Mapping[str, Any]) -> str:
    """An error of a step: ``0.0123 N·m``."""
    return spoken(error["value"], unit=error["unit"], digits=4)


def history(steps: Sequence[Step], title: str = "") -> Sheet:
    """Every step with its errors on fitted and on held-out data."""
    rows: list[list[Any]] = []
    for s in steps:
        what = f"{s.action} {s.effect}".strip() + (f" ({s.because})" if s.because else "")
        fitted, aside = (", ".join(map(amount, s.of_each(kind).values())) for kind in ("fit", "held_out"))
        rows.append([s.step, what, fitted, cell(s.reduced_chi2), aside, cell(s.held_out_reduced_chi2)])
    return Sheet(title, ["step", "what", "fitted", "chi2/n", "held out", "chi2/n"], rows)


def candidates(found: Mapping[str, Any], most: int, title: str = "", *, valued: bool = False) -> Sheet:
    """The first rows of the ranking of a diagnosis, as ``--json`` prints it; with their parameters where `valued`."""
    ranking, error = found["ranking"][:most], found.get("error") or {}
    before = error.get("before") or {"unit": "1"}
    others = {e["before"]["observable"]: e["before"]["unit"] for e in error.get("others", ())}
    levels = before.get("level_dB") is not None and all("level_after_dB" in row for row in ranking)
    columns: list[dict[str, str]] = []
    for row in ranking:
        after, p = row.get("others_after", {}).values(), row["probability"]
        remarks = {"outside known range": not row["plausible"], "at its bound": row["at_bound"]}
        columns.append({
            "effects": " + ".join(placed(row["effects"], row["at"])),
            f"error after{_in_unit(before['unit'])}": f"{row['error_after']:.3g}",
            **{f"{n}{_in_unit(u)}": f"{rms:.3g}" for (n, u), rms in zip(others.items(), after)},
            **({"levels, dB": f"{before['level_dB']:.2g} to {row['level_after_dB']:.2g}"} if levels else {}),
            "probable": percent(p) if p >= 0.1 else f"{100 * p:.2g} %" if p >= 1e-4 else "< 0.01 %",
            "evidence": f"{row['ln_evidence']:+z.1f}",
            "": ", ".join(remark for remark, holds in remarks.items() if holds),
        })  # fmt: skip
        if valued:
            columns[-1]["parameters"] = "; ".join(
                f"{n.removeprefix(columns[-1]['effects'] + '.')} = {value_text(v)}"
                for n, v in row["parameters"].items()
            )
    return Sheet(title, list(columns[0]) if columns else [], [list(row.values()) for row in columns])


def _in_unit(unit: str) -> str:
    return f", {printed_unit(unit)}".removesuffix(", ")


def pulls(found: Sequence[Pull]) -> Sheet:
    """Values of a fit outside of what was known of them."""
    off = [f"{p.pull:+.1f}" if p.pull else "" for p in found]
    rows = [
        [p.parameter, spoken(p.value, unit=p.unit), p.range, by, "at its bound" * p.at_bound]
        for p, by in zip(found, off, strict=True)
    ]
    header = ["parameter", "value", "known", "off by", ""]
    return Sheet("Values outside the known range, in standard uncertainties", header, rows)


def readings(rows: Sequence[Mapping[str, Any]]) -> Sheet:
    """Proposed readings, one column each: conditions, what each explanation expects, and what that separates."""
    columns = []
    for row in rows:
        unit, sigmas = _in_unit(row["unit"]), (row.get("least_sigma"), row.get("separation_sigma"))
        columns.append({
            **{n: v if isinstance(v, str) else f"{v:g}" for n, v in row["conditions"].items()},
            **{f"{name}{unit}": f"{value:.4g}" for name, value in row["predictions"].items()},
            f"sigma{unit}": f"{row['sigma']:.2g}" if row.get("sigma") else "",
            "closest two, sigma apart": f"{sigmas[0]:.1f}" if sigmas[0] else "",
            "furthest two, sigma apart": f"{sigmas[1]:.1f}" if sigmas[1] else "",
            "separates": ["in part", "some", "all"][sum((s or 0) >= SEPARATES for s in sigmas)] if sigmas[1] else "",
        })  # fmt: skip
    lines = [[label, *(column[label] for column in columns)] for label in columns[0]]
    header = ["", *map(str, range(1, len(rows) + 1))]
    return Sheet("What to measure next", header, [line for line in lines if any(line[1:])])


def change(before: Step, after: Step) -> Sheet:
    """Errors at two steps, on fitted and on held-out data."""
    rows = [
        [
            data.split()[0], two["metric"].removeprefix("RMS of "), spoken(one["value"], digits=4),
            spoken(two["value"], digits=4), printed_unit(two["unit"]),
            f"{100 * (two['value'] / one['value'] - 1) if one['value'] else 0.0:+.0f} %",
        ]
        for data, one, two in error_pairs(before, after)
    ]  # fmt: skip
    header = ["data", "observable", "RMS before", "after", "unit", "change"]
    return Sheet(f"Step {after.step}: {after.action} {after.effect}", header, rows)


def bands(found: FrfErrors, receivers: str) -> Sheet:
    """Errors of a recording by third octaves: mean and range of levels, phases, CSAC, the worst channel.

    Of a single channel there is no range, and its CSAC is 1.
    """
    rows = []
    for b, band in enumerate(found.band_texts):
        level, phase = found.level_dB[:, b], found.phase_deg[:, b]
        used = np.flatnonzero(np.isfinite(level))
        worst = used[np.argmax(np.abs(level[used]) / found.u_level_dB[used, b])]
        rows.append([
            band, f"{level[used].mean():+z.2f}",
            (used.size > 1) * f"{level[used].min():+z.2f}..{level[used].max():+z.2f}",
            f"{np.abs(phase[used]).mean():.1f}", (used.size > 1) * f"{found.csac[b]:.4f}",
            f"{found.channels[worst]}: {level[worst]:+z.2f} +-{2 * found.u_level_dB[worst, b]:.2f}",
        ])  # fmt: skip
    frac = ", ".join(f"{c} {f:.4f}" for c, f in zip(found.channels, found.frac, strict=True) if f == f)
    partial = "(*: the lines cover only part of this third octave.)\n" if found.third.partial else ""
    header = ["Hz", "dB, mean", "dB, range", "|deg|, mean", "CSAC", "largest, dB (95 %)"]
    title = f"{found.recording}: model over measured, all {receivers}"
    about = "(FRAC and CSAC are less sensitive than chi-square and are shown for information only.)"
    return Sheet(title, header, rows, f"{partial}FRAC: {frac}\n{about}")


def gains(found: Mapping[str, Any], unit: str) -> Sheet:
    """Gains of the path of a recording of order lines."""
    columns = (found[name] for name in ("channel", "harmonic", "gain_dB", "phase_deg"))
    rows = [
        [channel, n, f"{level:+z.2f}", f"{phase:+z.1f}"]
        for channel, n, level, phase in zip(*columns, strict=True)
    ]
    title = (
        f"{found['recording']}: gains of the path, fitted to these lines. Without them the RMS error is "
        f"{spoken(found['rms_without'], unit=unit)}."
    )
    return Sheet(title, ["channel", "harmonic", "dB", "phase deg"], rows)


def blocks(found: Sequence[Block]) -> Sheet:
    """Conditions where a model fails."""
    rows = [
        [b.short_place, b.n, f"{b.z:+.1f}", f"{b.p_value:.1g}", ", ".join(filter(None, (b.text, b.most_at)))]
        for b in found
    ]
    title = "Where the model fails, most significant first"
    return Sheet(title, ["conditions", "values", "z", "p", ""], rows)


def visible(found: Diagnosis) -> tuple[Sheet, list[str]]:
    """Smallest detectable sizes of effects that the verdict does not name, and effects detectable at no size."""
    sizes = {n: v for n, v in found.smallest_visible.items() if n not in found.effects}
    known = {n: v for n, v in sizes.items() if v is not None}
    rows = [[n, spoken(v["value"], digits=2), printed_unit(v["unit"])] for n, v in known.items()]
    sheet = Sheet("Smallest detectable effects", ["effect", "size", ""], rows)
    return sheet, [n for n, v in sizes.items() if v is None]


def state_of(study: Study) -> list[str]:
    """What a figure of a study says of the model and of how well it fits."""
    effects = ", ".join(study.model_effects) or study.model.words.ideal
    errors = "; ".join(
        f"RMS error of {e.observable.replace('_', ' ')} {spoken(e.rms, unit=e.unit)} "
        f"({spoken(e.relative_rms, digits=2)} %)"
        for e in study.errors
    )
    chi2 = f"chi²/n {study.shown.reduced_chi2:.3g}, " if study.data.known else ""
    return [f"Model: {effects}", chi2 + errors]


def allowed_for(study: Study) -> str:
    """``model discrepancy of 0.5 % of the losses allowed for``; nothing where none is declared."""
    parts = [
        f"{of:g} % of {quantity} ({name})" for name, (quantity, of) in study.model.rig.discrepancies.items()
    ]
    if percent := study.data.discrepancy_percent:
        parts.insert(0, f"{percent:g} % of the {study.model.words.discrepancy_of}")
    return f"model discrepancy of {', '.join(parts)} allowed for" if parts else ""


def falls(before: Step, after: Step) -> str:
    """``Fitted: 0.0276 to 0.0065 Nm (-77 %); held out: 0.03 to 0.0072 Nm (-76 %)``."""
    texts = [f"{data.replace('-', ' ')}: {fall_text(a, b)}" for data, a, b in error_pairs(before, after)]
    whole = "; ".join(texts)
    return whole[:1].upper() + whole[1:]


def chance(p: float) -> str:
    """How probable a worse fit is by chance alone."""
    return "p < 1e-12" if p < 1e-12 else f"p = {p:.2g}"


def fall_text(before: Mapping[str, Any], after: Mapping[str, Any]) -> str:
    """``0.0276 to 0.0065 Nm (-77 %)``; of one and the same error, its value."""
    if before == after or not before["value"]:
        return spoken(after["value"], unit=after["unit"])
    change = 100 * (after["value"] / before["value"] - 1)
    return f"{spoken(before['value'], after['value'], unit=after['unit'])} ({change:+.0f} %)"
