"""Figures of a planetary gear in time: the article's 3, 4 and 7 to 12 for any rig, and its numbers beside ours.

``python docs/articles/planetary_gear_figures.py RIG.toml NUMBER FIGURE.png`` draws one and prints the numbers.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError
from specan.planetary_gear.model.dynamics import Motion, force_normal_angle, simulate
from specan.planetary_gear.model.kinematics import carrier_speed_ratio
from specan.planetary_gear.model.rig import Rig, read_rig
from specan.planetary_gear.model.simulated_recording import planet_centres
from specan.report.figure_style import COLOURS, heading, legend_above, new_figure, save_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Real = NDArray[np.float64]

DURATION_S = 1.0  # as in the article: lines of the spectra lie 1 Hz apart
SIZE = (7.2, 4.2)
PAIR_WINDOW_S = 0.06  # as in the article
SHOWN_TURNS = 2  # of the carrier
HARMONICS = {"pair": 4, "set": 3}  # of the mesh, in the article's text
SIDE_TURNS = 2.5  # of the carrier, shown to either side of a harmonic
LEAST_N = 1e-3  # lower end of the spectra: what is left below is the filter of the stored samples


@dataclass(frozen=True)
class Compared:
    """One number of the article beside ours."""

    what: str
    article: str
    here: str


@dataclass(frozen=True)
class _Drawing:
    """How a figure is drawn, of which machine, and which numbers belong to it."""

    machine: str
    draw: Callable[[Figure, Motion], None]
    compare: Callable[[Motion], list[Compared]]
    title: str


@styled
def figure(number: int, motion: Motion) -> Figure:
    """Draw one of the article's figures for a run in time.

    Parameters
    ----------
    number : int
        Of a gear pair: 3, the meshing force; 4, its spectrum. Of a planetary set: 7, the planets' centres; 8 and 9,
        vertical force of planet 1 on the ring and its spectrum; 10, those of all planets; 11 and 12, vertical force
        of planet 1 on the sun and its spectrum.
    motion : Motion
        At least `DURATION_S` long.
    """
    drawing = FIGURES[number]
    sheet = new_figure(SIZE[1], SIZE[0])
    drawing.draw(sheet, motion)
    heading(sheet, f"{drawing.title[:1].upper()}{drawing.title[1:]}", f"Figure {number} of the article")
    return sheet


def compared(number: int, motion: Motion) -> list[Compared]:
    """Numbers that the article says of a figure, beside those of a run."""
    return FIGURES[number].compare(motion)


def check_figure(number: int, rig: Rig) -> None:
    """Refuse a figure that there is not, or that is of another machine than the rig's.

    Raises
    ------
    RequestError
    """
    if number not in FIGURES:
        known = ", ".join(map(str, FIGURES))
        raise RequestError(f"there is no figure {number} of the planetary gear", expected=f"one of {known}")
    given = "pair" if rig.gear is None else "set"
    if FIGURES[number].machine != given:
        names = {"pair": "a gear pair", "set": "a planetary set"}
        possible = [str(n) for n, d in FIGURES.items() if d.machine == given]
        raise RequestError(
            f"figure {number} shows {names[FIGURES[number].machine]}, and the rig file describes {names[given]}",
            expected=f"figure {', '.join(possible)}, or another rig file",
        )


# --- signals --------------------------------------------------------------------------------------------


def _vertical(motion: Motion, mesh: str) -> Real:
    """Vertical parts of the forces of all planets on sun or ring, N."""
    on_sun, on_ring = force_normal_angle(motion.rig, motion)
    force, angle = (motion.ring_force, on_ring) if mesh == "ring" else (motion.sun_force, on_sun)
    return np.asarray(force * np.sin(angle))


def _spectrum(samples: Real, motion: Motion) -> tuple[Real, Real]:
    """Frequencies and peak amplitudes over the whole run; lines fall on its bins where it holds whole turns."""
    rate = 1.0 / (motion.time[1] - motion.time[0])
    found = np.abs(np.fft.rfft(samples - samples.mean())) * 2 / samples.size
    return np.arange(found.size) * rate / samples.size, found


def _mesh_hz(rig: Rig) -> float:
    if rig.gear is None:
        assert rig.pair is not None
        return rig.pair.z_driver * rig.pair.driver_speed_hz
    return rig.gear.z_ring * _carrier_hz(rig)


def _carrier_hz(rig: Rig) -> float:
    assert rig.gear is not None
    return rig.operation.sun_speed_hz * carrier_speed_ratio(rig.gear)


# --- drawings -------------------------------------------------------------------------------------------


def _pair_force(sheet: Figure, motion: Motion) -> None:
    axes = sheet.subplots()
    shown = motion.time < PAIR_WINDOW_S
    axes.plot(1e3 * motion.time[shown], _vertical(motion, "sun")[0, shown], color=COLOURS[0], linewidth=1.0)
    axes.set(xlabel="Time / ms", ylabel="Vertical force / N", xlim=(0, 1e3 * PAIR_WINDOW_S))


def _pair_spectrum(sheet: Figure, motion: Motion) -> None:
    axes = sheet.subplots()
    frequency, size = _spectrum(_vertical(motion, "sun")[0], motion)
    top = (HARMONICS["pair"] + 0.5) * _mesh_hz(motion.rig)
    _draw_spectrum(axes, frequency, size, top)
    for n in range(1, HARMONICS["pair"] + 1):
        at = n * _mesh_hz(motion.rig)
        near = np.abs(frequency - at) < 0.25 * _mesh_hz(motion.rig)
        highest = np.flatnonzero(near)[np.argmax(size[near])]
        axes.annotate(
            f"{frequency[highest]:.0f} Hz\n{size[highest]:.2f} N", (frequency[highest], size[highest]),
            xytext=(0, 4), textcoords="offset points", ha="center", fontsize="small",
        )  # fmt: skip
    axes.set_ylim(top=30 * size[frequency < top].max())


def _draw_spectrum(axes: Axes, frequency: Real, size: Real, top: float) -> None:
    shown = (frequency > 0) & (frequency <= top)
    axes.vlines(frequency[shown], LEAST_N, np.maximum(size[shown], LEAST_N), color=COLOURS[0], linewidth=1.2)
    axes.set(
        xlabel="Frequency / Hz", ylabel="Amplitude / N", yscale="log",
        xlim=(0, top), ylim=(LEAST_N, None),
    )  # fmt: skip


def _centres(sheet: Figure, motion: Motion) -> None:
    axes = sheet.subplots()
    shown = motion.time <= SHOWN_TURNS / _carrier_hz(motion.rig)
    for i, (x, y) in enumerate(planet_centres(motion)):
        axes.plot(1e3 * motion.time[shown], 1e3 * x[shown], color=COLOURS[i % 7], label=f"planet {i + 1}, x")
        axes.plot(
            1e3 * motion.time[shown], 1e3 * y[shown], "--", color=COLOURS[i % 7], label=f"planet {i + 1}, y"
        )
    axes.set(xlabel="Time / ms", ylabel="Place of the centre / mm", xlim=(0, 1e3 * motion.time[shown][-1]))
    axes.margins(y=0.05)
    legend_above(axes)


def _force(mesh: str, planets: slice) -> Callable[[Figure, Motion], None]:
    def draw(sheet: Figure, motion: Motion) -> None:
        axes = sheet.subplots()
        shown = motion.time <= SHOWN_TURNS / _carrier_hz(motion.rig)
        chosen = _vertical(motion, mesh)[planets]
        for i, force in enumerate(chosen):
            axes.plot(
                1e3 * motion.time[shown], force[shown], color=COLOURS[i % 7], linewidth=0.8,
                label=f"planet {i + 1}",
            )  # fmt: skip
        axes.set(
            xlabel="Time / ms", ylabel=f"Vertical force on the {mesh} / N",
            xlim=(0, 1e3 * motion.time[shown][-1]),
        )  # fmt: skip
        if len(chosen) > 1:
            legend_above(axes)

    return draw


def _force_spectrum(mesh: str) -> Callable[[Figure, Motion], None]:
    """The spectrum up to its strongest lines above, below it what lies about harmonics of the mesh."""

    def draw(sheet: Figure, motion: Motion) -> None:
        frequency, size = _spectrum(_vertical(motion, mesh)[0], motion)
        harmonic, carrier = _mesh_hz(motion.rig), _carrier_hz(motion.rig)
        strongest = _strongest(frequency, size, harmonic)
        numbers = [*range(1, HARMONICS["set"] + 1), strongest]
        panels = sheet.subplot_mosaic([["all"] * len(numbers), [f"{n}" for n in numbers]])
        whole = panels["all"]
        _draw_spectrum(whole, frequency, size, (strongest + 1.5) * harmonic)
        whole.set_ylim(top=5 * size.max())
        whole.annotate(
            f"carrier, {carrier:.3g} Hz", (carrier, size[np.argmin(np.abs(frequency - carrier))]),
            xytext=(6, -8), textcoords="offset points", fontsize="small",
        )  # fmt: skip
        for n in numbers:
            at, beside = n * harmonic, panels[f"{n}"]
            near = np.abs(frequency - at) < SIDE_TURNS * carrier
            beside.vlines(
                frequency[near], LEAST_N, np.maximum(size[near], LEAST_N), color=COLOURS[0], linewidth=1.6
            )
            beside.set(yscale="log", ylim=(LEAST_N, 100.0), xlabel="Frequency / Hz")
            beside.set_xlim(at - SIDE_TURNS * carrier, at + SIDE_TURNS * carrier)
            beside.set_xticks([at - carrier, at + carrier])
            for axes in (whole, beside):
                axes.axvline(at, color=COLOURS[1], linestyle=":", linewidth=1.0)
            beside.set_title(f"harmonic {n}: {at:.0f} Hz", fontsize="small", color=COLOURS[1])
        panels["1"].set_ylabel("Amplitude / N")

    return draw


def _strongest(frequency: Real, size: Real, harmonic: float) -> int:
    """Number of the harmonic of the mesh beside which the highest line lies."""
    meshing = frequency > 0.5 * harmonic
    return round(float(frequency[meshing][np.argmax(size[meshing])] / harmonic))


# --- numbers --------------------------------------------------------------------------------------------


def _of_pair_force(motion: Motion) -> list[Compared]:
    force = _vertical(motion, "sun")[0]
    return [
        Compared(
            "mean vertical force: torque over pitch radius",
            "not given",
            f"{force.mean():.0f} N, within {np.ptp(force):.0f} N",
        )
    ]


def _of_pair_spectrum(motion: Motion) -> list[Compared]:
    """The article prints 700 and 940 Hz for 3 x 240 and 4 x 240."""
    frequency, size = _spectrum(_vertical(motion, "sun")[0], motion)
    printed = ("240 Hz", "480 Hz", "700 Hz (misprint)", "940 Hz (misprint)")
    found = []
    for n, said in enumerate(printed, 1):
        near = np.abs(frequency - n * _mesh_hz(motion.rig)) < 0.5 * _mesh_hz(motion.rig)
        at = frequency[near][np.argmax(size[near])]
        found.append(Compared(f"line {n} of the mesh", said, f"{at:.0f} Hz, {size[near].max():.2f} N"))
    return found


def _of_centres(motion: Motion) -> list[Compared]:
    places = np.array([x + 1j * y for x, y in planet_centres(motion)])
    turned = np.degrees(np.angle(places / places[0])).mean(axis=1) % 360
    radius = 1e3 * np.abs(places)
    rate = np.ptp(np.unwrap(np.angle(places[0]))) / (2 * np.pi) / (motion.time[-1] - motion.time[0])
    return [
        Compared("turns of the carrier", "8 Hz", f"{rate:.3f} Hz"),
        Compared("one planet behind the other", "120 degrees", ", ".join(f"{a:.1f}" for a in turned[1:]) + " degrees"),
        Compared("distance from the axis", "not given", f"{radius.max():.1f} mm"),
    ]  # fmt: skip


def _of_force(mesh: str) -> Callable[[Motion], list[Compared]]:
    def compare(motion: Motion) -> list[Compared]:
        frequency, size = _spectrum(_vertical(motion, mesh)[0], motion)
        slow = frequency[np.argmax(size)]
        force = motion.ring_force if mesh == "ring" else motion.sun_force
        found = [
            Compared("turns once with the carrier", "8 Hz", f"{slow:.0f} Hz"),
            Compared("mean force along the line of action", "not given", f"{force[0].mean():.1f} N"),
        ]
        if mesh == "sun":
            ratio = motion.sun_force.mean() / motion.ring_force.mean()
            found.append(Compared("force on the sun over force on the ring", "1/3", f"{ratio:.3f}"))
        return found

    return compare


def _of_force_spectrum(mesh: str) -> Callable[[Motion], list[Compared]]:
    def compare(motion: Motion) -> list[Compared]:
        frequency, size = _spectrum(_vertical(motion, mesh)[0], motion)
        carrier, found = _carrier_hz(motion.rig), []
        printed = dict(enumerate(("528 Hz, reduced", "1056 Hz, reduced", "1584 Hz, reduced"), 1))
        printed[_strongest(frequency, size, _mesh_hz(motion.rig))] = "the strongest, beyond its figure"
        for n, said in printed.items():
            at = n * _mesh_hz(motion.rig)
            near = np.flatnonzero(np.abs(frequency - at) < 10 * carrier)
            two = np.sort(near[np.argsort(size[near])[-2:]])
            itself = size[np.argmin(np.abs(frequency - at))]
            lines = " and ".join(f"{f:.0f}" for f in frequency[two])
            found.append(
                Compared(
                    f"mesh harmonic {n}",
                    f"{said}; modulated by 8 Hz",
                    f"{lines} Hz, {size[two].mean():.2g} N; at {at:.0f} Hz below {max(itself, LEAST_N):.1g} N",
                )
            )
        return found

    return compare


def _of_all_forces(motion: Motion) -> list[Compared]:
    forces = _vertical(motion, "ring")
    turn = np.exp(-2j * np.pi * _carrier_hz(motion.rig) * motion.time)
    slow = forces @ turn
    apart = np.degrees(np.angle(slow / slow[0])) % 360
    return [
        Compared(
            "one planet's force behind the other's", "clearly shifted in phase",
            ", ".join(f"{a:.1f}" for a in apart[1:]) + " degrees",
        )
    ]  # fmt: skip


FIGURES: dict[int, _Drawing] = {
    3: _Drawing("pair", _pair_force, _of_pair_force, "vertical meshing force of the gear pair"),
    4: _Drawing("pair", _pair_spectrum, _of_pair_spectrum, "spectrum of the vertical meshing force"),
    7: _Drawing("set", _centres, _of_centres, "centres of the planets"),
    8: _Drawing("set", _force("ring", slice(1)), _of_force("ring"), "vertical force of planet 1 on the ring"),
    9: _Drawing(
        "set",
        _force_spectrum("ring"),
        _of_force_spectrum("ring"),
        "spectrum of the vertical force, planet 1 on the ring",
    ),
    10: _Drawing(
        "set", _force("ring", slice(None)), _of_all_forces, "vertical forces of the planets on the ring"
    ),
    11: _Drawing("set", _force("sun", slice(1)), _of_force("sun"), "vertical force of planet 1 on the sun"),
    12: _Drawing(
        "set",
        _force_spectrum("sun"),
        _of_force_spectrum("sun"),
        "spectrum of the vertical force, planet 1 on the sun",
    ),
}


RATE = 51200.0


def main(rig_file: str, number: str, picture: str) -> None:
    """Draw one figure, and print what the article says of it beside what is found here."""
    rig, wanted = read_rig(tomllib.loads(Path(rig_file).read_text(encoding="utf-8"))), int(number)
    check_figure(wanted, rig)
    motion = simulate(rig, DURATION_S, sampling_rate=RATE)
    save_figure(figure(wanted, motion), Path(picture))
    for row in compared(wanted, motion):
        print(f"{row.what}: {row.article} in the article, {row.here} here")


if __name__ == "__main__":
    main(*sys.argv[1:])
