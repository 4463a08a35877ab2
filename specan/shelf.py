# ruff: noqa: B008 - parameters are read from the signature
"""Effects that machines are often missing, for models of rates, each with its source.

A function gives those of one kind for names of your model. With each name goes a size that it usually has in your
recordings, and its unit: from these the plausible ranges of the parameters follow. ::

    effects = shelf.mechanics(force=("spring", 100, "N"), x=("x", 5, "mm"), v=("v", 400, "mm/s"))
    effects += shelf.sensor(of=("x", 5, "mm"))
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.signal import lfilter

from specan.models.effect import Effect, Parameter, effect
from specan.models.rates import State

Named = tuple[str, float, str]  # name, usual size, unit
OVER = 0.005  # (3 % of the usual level) to the power 1.5: a brim lets the usual flow out at that height
SHARP = 0.01  # of the usual speed, over which friction turns round


def mechanics(force: Named, x: Named, v: Named, *, prefix: str = "") -> list[Effect]:
    """Effects on a force that holds a mass back: springs, friction, hysteresis, what is attached to it.

    Parameters
    ----------
    force : (name, size, unit)
        Quantity that they add to, positive where it pulls against x and v.
    x, v : (name, size, unit)
        Displacement and velocity; angle and rate of turning do as well.
    prefix : str
        Before the name of each, where a model has several such forces.

    Returns
    -------
    list of Effect

    Examples
    --------
    >>> found = mechanics(force=("spring", 100, "N"), x=("x", 5, "mm"), v=("v", 400, "mm/s"))
    >>> [one.name for one in found][:3]
    ['cubic-spring', 'quadratic-spring', 'quintic-spring']
    """
    on = _On(force, {"x": x[0], "v": v[0], "time": "time"}, prefix)
    return [*_springs(on, x), *_friction(on, x, v), *_hysteresis(on, x, v), *_attached(on, x, v)]


class _On:
    """A quantity that effects act on, and what the arguments of their functions are called in the model."""

    def __init__(self, of: Named, reads: Mapping[str, str], prefix: str, instrument: bool = False) -> None:
        (self.name, self.size, self.unit), self.reads, self.prefix = of, dict(reads), prefix
        self.instrument = instrument

    def amplitude(self, doc: str, per: str = "", by: float = 1.0, either: bool = False) -> Parameter:
        """A tenth of the usual size over something else."""
        unit, size = (f"{self.unit}/{per}" if per else self.unit), self.size / by
        return Parameter(
            0.1 * size, unit, min=1e-3 * size if not either else -size, max=size, lower=-20 * size if either else 0.0,
            upper=20 * size, doc=doc,
        )  # fmt: skip

    def made(
        self,
        name: str,
        function: Callable[..., Any],
        source: str,
        neutral: tuple[str, ...] = ("size",),
        states: Mapping[str, State] | None = None,
        **given: Any,
    ) -> Effect:
        """The effect with the names of the model, and of its own states, in place of those of its arguments."""
        own = {key: f"{self.prefix}{key}".replace("-", "_") for key in states or {}}
        names = {**self.reads, **own}
        parts = {own[key]: _with_names(state, names) for key, state in (states or {}).items()}
        given.setdefault("adds_to", self.name)
        made = effect(
            f"{self.prefix}{name}", neutral=dict.fromkeys(neutral, 0.0), reference=source, states=parts,
            instrument=self.instrument, **given,
        )(function)  # fmt: skip
        return replace(made, reads=tuple(names.get(read, read) for read in made.reads))


def _with_names(state: State, names: Mapping[str, str]) -> State:
    code = getattr(state.rate, "__code__")  # noqa: B009 - a function
    arguments = code.co_varnames[: code.co_argcount]
    return replace(state, reads=tuple(names[a] for a in arguments if a in names))


def _springs(on: _On, x: Named) -> list[Effect]:
    reach, unit = x[1], x[2]

    def cubic(x, *, size=on.amplitude("stiffness", f"{unit}^3", reach**3, either=True)):
        """The spring hardens or softens with the cube of the displacement, alike to both sides."""
        return size * x**3

    def quadratic(x, *, size=on.amplitude("stiffness", f"{unit}^2", reach**2, either=True)):
        """The spring is stiffer to one side."""
        return size * x * x

    def quintic(x, *, size=on.amplitude("stiffness", f"{unit}^5", reach**5, either=True)):
        """The spring hardens late and quickly."""
        return size * x**5

    def one_sided(x, *, size=on.amplitude("stiffness", unit, reach, either=True)):
        """Another stiffness to the positive side: a breathing crack, a contact that opens."""
        return size * np.maximum(x, 0.0)

    def dead_zone(
        x,
        *,
        size=on.amplitude("stiffness", unit, reach),
        gap=Parameter(
            0.2 * reach, unit, min=0.01 * reach, max=reach, lower=0, upper=10 * reach, doc="half of the gap"
        ),
    ):
        """A stiffness does not act within a gap: backlash, play of a joint."""
        return -size * np.minimum(np.maximum(x, -gap), gap)

    def stop(
        x,
        *,
        size=on.amplitude("stiffness", unit, 0.1 * reach),
        place=Parameter(0.8 * reach, unit, min=-3 * reach, max=3 * reach, doc="where it begins"),
    ):
        """A stop on the positive side."""
        return size * np.maximum(x - place, 0.0)

    def two_stops(
        x,
        *,
        size=on.amplitude("stiffness", unit, 0.1 * reach),
        place=Parameter(0.8 * reach, unit, min=0.1 * reach, max=3 * reach, doc="where they begin"),
    ):
        """Stops on both sides."""
        return size * (np.maximum(x - place, 0.0) + np.minimum(x + place, 0.0))

    def saturating(
        x,
        *,
        size=on.amplitude("force", either=True),
        knee=Parameter(
            0.3 * reach, unit, min=0.03 * reach, max=2 * reach, lower=1e-3 * reach, doc="where it saturates"
        ),
    ):
        """A force that grows no further beyond some displacement."""
        return size * np.tanh(x / knee)

    def offset(x, *, size=on.amplitude("force", either=True)):
        """A constant force: weight, preload, a fan."""
        return size + 0.0 * x

    def drift(x, time, *, size=on.amplitude("stiffness per second", f"{unit}/s", 10 * reach, either=True)):
        """The stiffness drifts while it is recorded, as with warming."""
        return size * x * time

    def cogging(
        x,
        *,
        size=on.amplitude("sine", either=True),
        cosine=on.amplitude("cosine", either=True),
        pitch=Parameter(0.5 * reach, unit, min=0.1 * reach, max=4 * reach, lower=0.01 * reach, doc="period"),
    ):
        """A force that repeats with the displacement: magnets and teeth of a motor, tooth after tooth."""
        return size * np.sin(2 * np.pi * x / pitch) + cosine * (np.cos(2 * np.pi * x / pitch) - 1)

    duffing = "G. Duffing, Erzwungene Schwingungen bei veränderlicher Eigenfrequenz, Vieweg 1918"
    nayfeh = "A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, Wiley 1979"
    shaw = "S. W. Shaw, P. J. Holmes, J. Sound Vib. 90 (1983) 129"
    return [
        on.made("cubic-spring", cubic, duffing),
        on.made("quadratic-spring", quadratic, nayfeh),
        on.made("quintic-spring", quintic, nayfeh),
        on.made("one-sided-spring", one_sided, shaw),
        on.made("backlash", dead_zone, "M. Nordin, P.-O. Gutman, Automatica 38 (2002) 1633"),
        on.made("stop", stop, shaw),
        on.made("two-stops", two_stops, shaw),
        on.made("saturating-spring", saturating, nayfeh),
        on.made("constant-force", offset, "I. Newton, Principia, 1687, law II"),
        on.made("stiffness-drift", drift, "ISO 6721-1:2019 (modulus over temperature)"),
        on.made("cogging", cogging, "T. M. Jahns, W. L. Soong, IEEE Trans. Ind. Electron. 43 (1996) 321",
                neutral=("size", "cosine")),
    ]  # fmt: skip


def _friction(on: _On, x: Named, v: Named) -> list[Effect]:
    speed, unit, reach = v[1], v[2], x[1]
    sharp = SHARP * speed

    def dry(v, *, size=on.amplitude("friction")):
        """Friction that knows only the direction."""
        return size * np.tanh(v / sharp)

    def viscous(v, *, size=on.amplitude("damping", unit, speed, either=True)):
        """Friction in proportion to the speed."""
        return size * v

    def stribeck(
        v,
        *,
        size=on.amplitude("rise at rest"),
        slow=Parameter(
            0.1 * speed, unit, min=0.01 * speed, max=speed, lower=2e-3 * speed, doc="speed of the fall"
        ),
    ):
        """Friction that is larger near rest and falls while a film of oil builds up."""
        return size * np.exp(-((v / slow) ** 2)) * np.tanh(v / sharp)

    def drag(v, *, size=on.amplitude("drag", f"({unit})^2", speed**2)):
        """Drag of air or water, with the square of the speed."""
        return size * v * np.abs(v)

    def cubic(v, *, size=on.amplitude("damping", f"({unit})^3", speed**3, either=True)):
        """Damping with the cube of the speed."""
        return size * v**3

    def root(v, *, size=on.amplitude("friction at the usual speed")):
        """Friction that grows ever more slowly, with the root of the speed."""
        return size * np.sqrt(np.abs(v) / speed) * np.tanh(v / sharp)

    def one_way(v, *, size=on.amplitude("damping", unit, speed, either=True)):
        """Another damping in one direction, as in a shock absorber."""
        return size * np.maximum(v, 0.0)

    def by_place(x, v, *, size=on.amplitude("damping at the usual size", unit, speed, either=True)):
        """Damping that grows with the square of the displacement; negative, and with a positive one, self-excited."""
        return size * v * (x / reach) ** 2

    def leaf(x, v, *, size=on.amplitude("friction at the usual size")):
        """Friction in proportion to the displacement: leaf springs, damping of a material."""
        return size * np.abs(x) / reach * np.tanh(v / sharp)

    coulomb = "C. A. Coulomb, Théorie des machines simples, 1785"
    nayfeh = "A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, Wiley 1979"
    return [
        on.made("dry-friction", dry, coulomb),
        on.made("viscous-friction", viscous, "G. G. Stokes, Trans. Camb. Phil. Soc. 9 (1851) 8"),
        on.made("stribeck-friction", stribeck, "L. C. Bo, D. Pavelescu, Wear 82 (1982) 277"),
        on.made("quadratic-drag", drag, "J. R. Morison et al., J. Petroleum Technol. 2 (1950) 149"),
        on.made("cubic-damping", cubic, nayfeh),
        on.made("root-friction", root, "B. Armstrong-Hélouvry et al., Automatica 30 (1994) 1083"),
        on.made("one-way-damping", one_way, "S. Duym, Vehicle System Dynamics 33 (2000) 247"),
        on.made("damping-by-place", by_place, "B. van der Pol, Phil. Mag. 2 (1926) 978"),
        on.made("leaf-friction", leaf, "T. J. Reid, J. R. Aeronaut. Soc. 60 (1956) 283"),
    ]  # fmt: skip


def _hysteresis(on: _On, x: Named, v: Named) -> list[Effect]:
    reach, unit, speed = x[1], x[2], v[1]
    pace = speed / reach

    def until(part: float) -> Parameter:
        return Parameter(
            part * reach,
            unit,
            min=0.01 * reach,
            max=reach,
            lower=3e-3 * reach,
            upper=10 * reach,
            doc="displacement to slip",
        )

    def settles() -> Parameter:
        return Parameter(
            1 / pace,
            "s",
            min=0.05 / pace,
            max=20 / pace,
            lower=0.01 / pace,
            upper=1e3 / pace,
            doc="time constant",
        )

    def wen_rate(v, bouc_wen, slip):
        return v - 0.5 * (np.abs(v) * bouc_wen + v * np.abs(bouc_wen)) / slip

    def wen(bouc_wen, *, size=on.amplitude("force of slip"), slip=until(0.2)):
        """Hysteresis: a spring that yields, smoothly."""
        return size * bouc_wen / slip

    def dahl_rate(v, dahl, slip):
        return v - np.abs(v) * dahl / slip

    def dahl_force(dahl, *, size=on.amplitude("friction"), slip=until(0.05)):
        """Friction whose contacts bend before they slide."""
        return size * dahl / slip

    def lugre_rate(v, lugre, slip, rise, slow):
        return v - np.abs(v) * lugre / (slip * (1 + rise * np.exp(-((v / slow) ** 2))))

    def lugre_force(
        lugre,
        *,
        size=on.amplitude("friction"),
        slip=until(0.05),
        rise=Parameter(0.5, min=0.05, max=2, lower=0, doc="rise at rest"),
        slow=Parameter(
            0.1 * speed, v[2], min=0.01 * speed, max=speed, lower=2e-3 * speed, doc="speed of the fall"
        ),
    ):
        """Bristles that bend, and friction that falls with the speed."""
        return size * lugre / slip

    def maxwell_rate(v, maxwell, settling):
        return v - maxwell / settling

    def maxwell_force(maxwell, *, size=on.amplitude("stiffness", unit, reach), settling=settles()):
        """A spring and a damper in series: rubber, a mount."""
        return size * maxwell

    wen_1976 = "Y.-K. Wen, J. Eng. Mech. Div. ASCE 102 (1976) 249"
    dahl_1968 = "P. R. Dahl, Aerospace Corp. TOR-0158(3107-18)-1, 1968"
    lugre_1995 = "C. Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995) 419"
    maxwell_1867 = "J. C. Maxwell, Phil. Trans. R. Soc. 157 (1867) 49"
    return [
        on.made("bouc-wen", wen, wen_1976, states={"bouc_wen": State(unit, rate=wen_rate)}),
        on.made("dahl-friction", dahl_force, dahl_1968, states={"dahl": State(unit, rate=dahl_rate)}),
        on.made("lugre-friction", lugre_force, lugre_1995, states={"lugre": State(unit, rate=lugre_rate)}),
        on.made(
            "maxwell-element", maxwell_force, maxwell_1867, states={"maxwell": State(unit, rate=maxwell_rate)}
        ),
    ]


def _attached(on: _On, x: Named, v: Named) -> list[Effect]:
    reach, unit, speed, of_speed = x[1], x[2], v[1], v[2]
    omega = speed / reach
    usual = omega / (2 * np.pi)

    def tuned_x_rate(tuned_v):
        return tuned_v

    def tuned_v_rate(x, v, tuned_x, tuned_v, tuned, ratio):
        own = 2 * np.pi * tuned
        return own * own * (x - tuned_x) + 2 * ratio * own * (v - tuned_v)

    def tuned_mass(
        x,
        v,
        tuned_x,
        tuned_v,
        *,
        size=on.amplitude("mass", f"({of_speed}/s)", 10 * speed * omega),
        tuned=Parameter(
            usual,
            "Hz",
            min=0.2 * usual,
            max=5 * usual,
            lower=0.01 * usual,
            upper=50 * usual,
            doc="natural frequency",
        ),
        ratio=Parameter(0.03, min=0.001, max=0.3, lower=0, upper=2, doc="damping ratio"),
    ):
        """A small mass on a spring that is fastened to it."""
        own = 2 * np.pi * tuned
        return size * (own * own * (x - tuned_x) + 2 * ratio * own * (v - tuned_v))

    def tone(
        time,
        *,
        size=on.amplitude("cosine", either=True),
        sine=on.amplitude("sine", either=True),
        frequency=Parameter(
            usual, "Hz", min=0.1 * usual, max=10 * usual, lower=0.01 * usual, upper=100 * usual
        ),
    ):
        """A tone from elsewhere: unbalance, hum."""
        return size * np.cos(2 * np.pi * frequency * time) + sine * np.sin(2 * np.pi * frequency * time)

    def parametric(
        x,
        time,
        *,
        size=on.amplitude("cosine", unit, reach, either=True),
        sine=on.amplitude("sine", unit, reach, either=True),
        frequency=Parameter(
            2 * usual, "Hz", min=0.2 * usual, max=10 * usual, lower=0.01 * usual, upper=100 * usual
        ),
    ):
        """A stiffness that pulses with time, as of teeth in mesh."""
        return x * (size * np.cos(2 * np.pi * frequency * time) + sine * np.sin(2 * np.pi * frequency * time))

    return [
        on.made("tuned-mass", tuned_mass, "H. Frahm, US patent 989958, 1911", states={
            "tuned_x": State(unit, rate=tuned_x_rate), "tuned_v": State(of_speed, rate=tuned_v_rate)}),
        on.made("tone", tone, "J. P. Den Hartog, Mechanical Vibrations, 1934", neutral=("size", "sine")),
        on.made("pulsing-stiffness", parametric, "É. Mathieu, J. Math. Pures Appl. 13 (1868) 137",
                neutral=("size", "sine")),
    ]  # fmt: skip


def sensor(of: Named, *, input: str = "", late: float = 1e-3, prefix: str = "") -> list[Effect]:
    """Faults of the sensor and its amplifier, on what is measured of a state or quantity.

    Parameters
    ----------
    of : (name, size, unit)
        The observable, in the unit in which it is measured.
    input : str
        A recorded input that may leak into it.
    late : float
        Usual delay in s.
    prefix : str
        Before each name, where a model has several sensors.

    Examples
    --------
    >>> [one.name for one in sensor(of=("x", 5, "mm"))][:2]
    ['x-gain', 'x-zero']
    """
    name, _, unit = of
    on = _On(
        (f"{name}_measured", *of[1:]),
        {"value": f"{name}_at_sensor", "given": input},
        prefix or f"{name}-",
        instrument=True,
    )
    found = _channel(on, unit, late)
    if input:

        def leaks(
            given,
            *,
            size=Parameter(0.01, min=-0.1, max=0.1, lower=-10, upper=10, doc="per unit of the input"),
        ):
            """The input leaks into the channel."""
            return size * given

        found.append(on.made("crosstalk", leaks, "IEC 61672-1:2013, 5.19"))
    return found


def actuator(of: Named, *, late: float = 1e-3, prefix: str = "") -> list[Effect]:
    """Faults of an input: of what drives it, or of how it is measured.

    Parameters
    ----------
    of : (name, size, unit)
        The input.
    late : float
        Usual delay in s.
    prefix : str
        Before each name.

    Examples
    --------
    >>> [one.name for one in actuator(of=("force", 30, "N"))][:3]
    ['force-gain', 'force-zero', 'force-zero-drift']
    """
    name, size, unit = of
    on = _On(of, {"value": f"{name}_channel"}, prefix or f"{name}-", instrument=True)

    def dead(
        value, *, size=Parameter(0.05 * size, unit, min=0.005 * size, max=0.5 * size, lower=0, upper=2 * size)
    ):
        """Small inputs do nothing."""
        return -np.minimum(np.maximum(value, -size), size)

    source = (
        "G. Tao, P. V. Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, 1996"
    )
    return [*_channel(on, unit, late), on.made("dead-band", dead, source)]


def _channel(on: _On, unit: str, late: float) -> list[Effect]:
    """What may be wrong with a channel; `value` is what it should show."""
    size = on.size

    def time_of(doc: str) -> Parameter:
        return Parameter(late, "s", min=0.05 * late, max=20 * late, lower=0, upper=1e3 * late, doc=doc)

    def gain(time, *, size=Parameter(0.02, min=-0.1, max=0.1, lower=-0.9, upper=10, doc="share")):
        """The sensitivity is off."""
        return 1 + size + 0.0 * time

    def zero(time, *, size=on.amplitude("offset", either=True)):
        """The zero is off."""
        return size + 0.0 * time

    def drift(time, *, size=on.amplitude("offset per second", "s", 10.0, either=True)):
        """The zero drifts."""
        return size * time

    def delay(value, time, *, size=time_of("delay")):
        """The channel is late."""
        return np.interp(time - size, time, value) - value

    def lag(value, time, *, size=time_of("time constant")):
        """A filter of first order, as of a slow sensor or amplifier."""
        step = float(time[1] - time[0]) if np.size(time) > 1 else 1.0
        kept = float(np.exp(-step / max(float(size), 1e-12)))
        first = np.ravel(value)[:1]
        return lfilter([1 - kept], [1, -kept], np.atleast_1d(value), zi=kept * first)[0] - value

    def square(value, *, size=on.amplitude("part at the usual size", either=True)):
        """The characteristic bends, alike to both sides."""
        return size * (value / usual) ** 2

    def cube(value, *, size=on.amplitude("part at the usual size", either=True)):
        """The characteristic bends: it begins to saturate."""
        return size * (value / usual) ** 3

    usual = size
    guide = "JCGM 106:2012; ISO 16063-21:2003"
    oppenheim = "A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 1989"
    return [
        on.made("gain", gain, guide, adds_to=(), scales=on.name),
        on.made("zero", zero, guide),
        on.made("zero-drift", drift, guide),
        on.made("delay", delay, oppenheim),
        on.made("lag", lag, oppenheim),
        on.made("bend", square, guide),
        on.made("saturation", cube, guide),
    ]


def tank(outflow: Named, level: Named, *, prefix: str = "") -> list[Effect]:
    """What else leaves a vessel, added to its outflow.

    Parameters
    ----------
    outflow, level : (name, size, unit)
        The quantity that is added to, and the state that drives it.
    prefix : str
        Before each name.

    Examples
    --------
    >>> [one.name for one in tank(outflow=("out", 1, "V/s"), level=("level", 5, "V"))]
    ['overflow', 'leak', 'laminar-outflow', 'constant-outflow']
    """
    on = _On(outflow, {"level": level[0]}, prefix)
    high, unit = level[1], level[2]

    def overflow(
        level,
        *,
        size=on.amplitude("flow at one usual level above", by=OVER),
        brim=Parameter(high, unit, min=0.3 * high, max=3 * high, lower=0, doc="level of the brim"),
    ):
        """Above its brim a vessel overflows."""
        return size * (np.maximum(level - brim, 0.0) / high) ** 1.5

    def leak(level, *, size=on.amplitude("flow at the usual level", either=True)):
        """An opening whose flow goes with the root of the level."""
        return size * np.sqrt(np.maximum(level, 0.0) / high)

    def laminar(level, *, size=on.amplitude("flow at the usual level", either=True)):
        """Flow through a narrow tube, in proportion to the level."""
        return size * level / high

    def constant(level, *, size=on.amplitude("flow", either=True)):
        """A pump, or evaporation."""
        return size + 0.0 * level

    return [
        on.made("overflow", overflow, "ISO 1438:2017 (weirs)"),
        on.made("leak", leak, "E. Torricelli, De motu gravium, 1644"),
        on.made("laminar-outflow", laminar, "G. Hagen, Ann. Phys. 46 (1839) 423"),
        on.made("constant-outflow", constant, "ISO 4006:1991"),
    ]
