"""Effects that machines are often missing, for models of rates, each with its source.

A function gives those of one kind for names of your model. Plausible ranges of their parameters follow from the sizes
that these have in the recordings of a study, or that you give with their units. ::

    effects = shelf.mechanics(force="spring", x="x", v="v") + shelf.sensor(of="x")
    effects = shelf.mechanics(force=("spring", 100, "N"), x=("x", 5, "mm"), v=("v", 400, "mm/s"))
"""

# ruff: noqa: B008  defaults are parameters, made for one model
from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import PPoly
from scipy.signal import lfilter

from specan.errors import RequestError
from specan.models.effect import Effect, Parameter, effect
from specan.models.march import as_cubics
from specan.models.rates import State, Unsized

Named = tuple[str, float, str]  # name, usual size, unit
Effects = list[Effect] | list[Unsized]

OVER = 0.005  # (3 % of the usual level) to the power 1.5: a brim lets the usual flow out at that height
LARGEST = 5.0  # of the usual size, which a model that is far off tells no better
SHARP = 0.001  # of the usual speed, over which friction turns round

NAYFEH = "A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, Wiley 1979"
SHAW = "S. W. Shaw, P. J. Holmes, J. Sound Vib. 90 (1983) 129"
GUIDE = "JCGM 106:2012; ISO 16063-21:2003"
OPPENHEIM = "A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 1989"


class _Usual(NamedTuple):
    """A quantity of the model as it usually is: what the ranges of parameters are shares of."""

    name: str
    size: float
    unit: str

    def part(self, doc: str, default: float, low: float, high: float, *domain: float | None) -> Parameter:
        """A parameter in its unit; all numbers are shares of the usual size."""
        size, (lower, upper) = self.size, [*domain, None, None][:2]
        return Parameter(
            default * size, self.unit, min=low * size, max=high * size, doc=doc,
            lower=None if lower is None else lower * size, upper=None if upper is None else upper * size,
        )  # fmt: skip


class _Shelf:
    """Effects on one quantity, and what the arguments of their functions are called in the model."""

    def __init__(
        self, of: Named, reads: Mapping[str, str], prefix: str, *others: Named, instrument: bool = False
    ) -> None:
        for given in (of, *others):
            if len(given) != 3:
                expected = 'its name, or also its usual size and unit: ("spring", 100, "N")'
                raise RequestError(f"{given!r} does not state its size", expected=expected)
        self.units = {name: unit for name, _, unit in (of, *others)}
        self.of, self.reads, self.prefix, self.instrument = _Usual(*of), dict(reads), prefix, instrument
        self.effects: list[Effect] = []

    def once(self, doc: str, per: str = "", by: float = 1.0) -> Parameter:
        """An amplitude above zero, a tenth of the usual size over something else."""
        return self._amplitude(doc, per, by, 1e-3, 0.0)

    def either(self, doc: str, per: str = "", by: float = 1.0) -> Parameter:
        """An amplitude of either sign."""
        return self._amplitude(doc, per, by, -LARGEST, -20.0)

    def _amplitude(self, doc: str, per: str, by: float, low: float, lower: float) -> Parameter:
        below = f"({per})" if set(per) & set("/*") and not per.startswith("(") else per
        unit = f"{self.of.unit}/{below}" if per else self.of.unit
        return _Usual("", self.of.size / by, unit).part(doc, 0.1, low, LARGEST, lower, 20.0)

    def __call__(
        self, name: str, source: str, *neutral: str, states: Mapping[str, State] | None = None, **given: Any
    ) -> Callable[[Callable[..., Any]], None]:
        """Put a function on the shelf, with the names of the model, and of its own states, for its arguments."""
        own = {key: f"{self.prefix}{key}".replace("-", "_") for key in states or {}}
        names = {**self.reads, **own}
        given.setdefault("adds_to", self.of.name)
        make = effect(
            f"{self.prefix}{name}", neutral=dict.fromkeys(("size", *neutral), 0.0), reference=source,
            states={own[key]: state for key, state in (states or {}).items()},
            instrument=self.instrument, units=self.units, **given,
        )  # fmt: skip

        def put(function: Callable[..., Any]) -> None:
            made = make(function)
            reading = {key: replace(state, reads=in_model(state.reads)) for key, state in made.states.items()}
            self.effects.append(replace(made, reads=in_model(made.reads), states=reading))

        def in_model(reads: Sequence[str]) -> tuple[str, ...]:
            return tuple(names.get(read, read) for read in reads)

        return put


def _of_recordings(
    *names: str, measured: str = ""
) -> Callable[[Callable[..., Effects]], Callable[..., Effects]]:
    """Let these arguments be names without sizes, which recordings tell then."""

    def decorate(function: Callable[..., Effects]) -> Callable[..., Effects]:
        @wraps(function)
        def effects_of(*given: Any, **more: Any) -> Effects:
            called = inspect.signature(function).bind(*given, **more).arguments
            named = {n: (called[n], f"{called[n]}{measured}") for n in names if isinstance(called[n], str)}
            return [Unsized(function, named, called)] if named else function(**called)

        return effects_of

    return decorate


@_of_recordings("force", "x", "v")
def mechanics(force: Named, x: Named, v: Named, *, prefix: str = "") -> Effects:
    """Effects on a force that holds a mass back: springs, friction, hysteresis, what is attached to it.

    Parameters
    ----------
    force : name or (name, size, unit)
        Quantity that they add to, positive where it pulls against x and v.
    x, v : name or (name, size, unit)
        Displacement and velocity; angle and rate of turning do as well.
    prefix : str
        Before the name of each, where a model has several such forces.

    Returns
    -------
    list of Effect
        A single element that waits for a recording where a name has no size.

    Examples
    --------
    >>> found = mechanics(force=("spring", 100, "N"), x=("x", 5, "mm"), v=("v", 400, "mm/s"))
    >>> [one.name for one in found][:3]
    ['cubic-spring', 'quadratic-spring', 'quintic-spring']
    """
    on = _Shelf(force, {"x": x[0], "v": v[0], "time": "time"}, prefix, x, v)
    _springs(on, _Usual(*x))
    _friction(on, _Usual(*x), _Usual(*v))
    _hysteresis(on, _Usual(*x), _Usual(*v))
    _attached(on, _Usual(*x), _Usual(*v))
    return on.effects


def _springs(on: _Shelf, usual: _Usual) -> None:
    _, reach, unit = usual

    @on("cubic-spring", "G. Duffing, Erzwungene Schwingungen bei veränderlicher Eigenfrequenz, Vieweg 1918")
    def cubic(x, *, size=on.either("stiffness", f"{unit}^3", reach**3)):
        """The spring hardens or softens with the cube of the displacement, alike to both sides."""
        return size * x**3

    @on("quadratic-spring", NAYFEH)
    def quadratic(x, *, size=on.either("stiffness", f"{unit}^2", reach**2)):
        """The spring is stiffer to one side."""
        return size * x * x

    @on("quintic-spring", NAYFEH)
    def quintic(x, *, size=on.either("stiffness", f"{unit}^5", reach**5)):
        """The spring hardens late and quickly."""
        return size * x**5

    @on("one-sided-spring", SHAW)
    def one_sided(x, *, size=on.either("stiffness", unit, reach)):
        """Another stiffness to the positive side: a breathing crack, a contact that opens."""
        return size * np.maximum(x, 0.0)

    half = usual.part("half of the gap", 0.2, 0.01, 1, 0, 10)

    @on("backlash", "M. Nordin, P.-O. Gutman, Automatica 38 (2002) 1633")
    def dead_zone(x, *, size=on.once("stiffness", unit, reach), gap=half):
        """A stiffness does not act within a gap: backlash, play of a joint."""
        return -size * np.minimum(np.maximum(x, -gap), gap)

    begins = usual.part("where it begins", 0.8, -3, 3)

    @on("stop", SHAW)
    def stop(x, *, size=on.once("stiffness", unit, 0.01 * reach), place=begins):
        """A stop on the positive side."""
        return size * np.maximum(x - place, 0.0)

    begin = usual.part("where they begin", 0.8, 0.1, 3)

    @on("two-stops", SHAW)
    def two_stops(x, *, size=on.once("stiffness", unit, 0.01 * reach), place=begin):
        """Stops on both sides."""
        return size * (np.maximum(x - place, 0.0) + np.minimum(x + place, 0.0))

    saturates = usual.part("where it saturates", 0.3, 0.03, 2, 1e-3)

    @on("saturating-spring", NAYFEH)
    def saturating(x, *, size=on.either("force"), knee=saturates):
        """A force that grows no further beyond some displacement."""
        return size * np.tanh(x / knee)

    @on("constant-force", "I. Newton, Principia, 1687, law II")
    def offset(x, *, size=on.either("force")):
        """A constant force: weight, preload, a fan."""
        return size * x**0

    @on("stiffness-drift", "ISO 6721-1:2019 (modulus over temperature)")
    def drift(x, time, *, size=on.either("stiffness per second", f"{unit}*s", 10 * reach)):
        """The stiffness drifts while it is recorded, as with warming."""
        return size * x * time

    period = usual.part("period", 0.5, 0.1, 4, 0.01)

    @on("cogging", "T. M. Jahns, W. L. Soong, IEEE Trans. Ind. Electron. 43 (1996) 321", "cosine")
    def cogging(x, *, size=on.either("sine"), cosine=on.either("cosine"), pitch=period):
        """A force that repeats with the displacement: magnets and teeth of a motor, tooth after tooth."""
        return size * np.sin(2 * np.pi * x / pitch) + cosine * (np.cos(2 * np.pi * x / pitch) - 1)


def _friction(on: _Shelf, displacement: _Usual, velocity: _Usual) -> None:
    (_, reach, _), (_, speed, unit) = displacement, velocity
    sharp = SHARP * speed

    @on("dry-friction", "C. A. Coulomb, Théorie des machines simples, 1785")
    def dry(v, *, size=on.once("friction")):
        """Friction that knows only the direction."""
        return size * np.minimum(np.maximum(v / sharp, -1.0), 1.0)

    @on("viscous-friction", "G. G. Stokes, Trans. Camb. Phil. Soc. 9 (1851) 8")
    def viscous(v, *, size=on.either("damping", unit, speed)):
        """Friction in proportion to the speed."""
        return size * v

    @on("stribeck-friction", "L. C. Bo, D. Pavelescu, Wear 82 (1982) 277")
    def stribeck(v, *, size=on.once("rise at rest"), slow=_speed_of_fall(velocity)):
        """Friction that is larger near rest and falls while a film of oil builds up."""
        return size * np.exp(-((v / slow) ** 2)) * np.minimum(np.maximum(v / sharp, -1.0), 1.0)

    @on("quadratic-drag", "J. R. Morison et al., J. Petroleum Technol. 2 (1950) 149")
    def drag(v, *, size=on.once("drag", f"({unit})^2", speed**2)):
        """Drag of air or water, with the square of the speed."""
        return size * v * np.abs(v)

    @on("cubic-damping", NAYFEH)
    def cubic(v, *, size=on.either("damping", f"({unit})^3", speed**3)):
        """Damping with the cube of the speed."""
        return size * v**3

    @on("root-friction", "B. Armstrong-Hélouvry et al., Automatica 30 (1994) 1083")
    def root(v, *, size=on.once("friction at the usual speed")):
        """Friction that grows ever more slowly, with the root of the speed."""
        return size * np.sqrt(np.abs(v) / speed) * np.minimum(np.maximum(v / sharp, -1.0), 1.0)

    @on("one-way-damping", "S. Duym, Vehicle System Dynamics 33 (2000) 247")
    def one_way(v, *, size=on.either("damping", unit, speed)):
        """Another damping in one direction, as in a shock absorber."""
        return size * np.maximum(v, 0.0)

    @on("damping-by-place", "B. van der Pol, Phil. Mag. 2 (1926) 978")
    def by_place(x, v, *, size=on.either("damping at the usual size", unit, speed)):
        """Damping that grows with the square of the displacement; negative, and with a positive one, self-excited."""
        return size * v * (x / reach) ** 2

    @on("leaf-friction", "T. J. Reid, J. R. Aeronaut. Soc. 60 (1956) 283")
    def leaf(x, v, *, size=on.once("friction at the usual size")):
        """Friction in proportion to the displacement: leaf springs, damping of a material."""
        return size * np.abs(x) / reach * np.minimum(np.maximum(v / sharp, -1.0), 1.0)


def _speed_of_fall(velocity: _Usual) -> Parameter:
    return velocity.part("speed of the fall", 0.1, 0.01, 1, 2e-3)


def _hysteresis(on: _Shelf, displacement: _Usual, velocity: _Usual) -> None:
    _, reach, unit = displacement
    slips = displacement.part("displacement to slip", 0.2, 0.01, 1, 3e-3, 10)
    # contacts of metal slip after 1 to 100 um
    slips_early = displacement.part("displacement to slip", 0.05, 2e-3, 1, 1e-3, 10)
    settles = _Usual("", reach / velocity.size, "s").part("time constant", 1, 0.05, 20, 0.01, 1e3)

    def wen_rate(v, bouc_wen, slip):
        return v - 0.5 * (np.abs(v) * bouc_wen + v * np.abs(bouc_wen)) / slip

    bristle = {"bouc_wen": State(unit, rate=wen_rate)}

    @on("bouc-wen", "Y.-K. Wen, J. Eng. Mech. Div. ASCE 102 (1976) 249", states=bristle)
    def wen(bouc_wen, *, size=on.once("force of slip"), slip=slips):
        """Hysteresis: a spring that yields, smoothly."""
        return size * bouc_wen / slip

    def dahl_rate(v, dahl, slip):
        return v - np.abs(v) * dahl / slip

    bristle = {"dahl": State(unit, rate=dahl_rate)}

    @on("dahl-friction", "P. R. Dahl, Aerospace Corp. TOR-0158(3107-18)-1, 1968", states=bristle)
    def dahl_force(dahl, *, size=on.once("friction"), slip=slips_early):
        """Friction whose contacts bend before they slide."""
        return size * dahl / slip

    def lugre_rate(v, lugre, slip, rise, slow):
        return v - np.abs(v) * lugre / (slip * (1 + rise * np.exp(-((v / slow) ** 2))))

    bristle = {"lugre": State(unit, rate=lugre_rate)}
    rises = Parameter(0.5, min=0.05, max=2, lower=0, doc="rise at rest")
    slows = _speed_of_fall(velocity)

    @on(
        "lugre-friction", "C. Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995) 419", states=bristle
    )
    def lugre_force(lugre, *, size=on.once("friction"), slip=slips_early, rise=rises, slow=slows):
        """Bristles that bend, and friction that falls with the speed."""
        return size * lugre / slip

    def maxwell_rate(v, maxwell, settling):
        return v - maxwell / settling

    spring = {"maxwell": State(unit, rate=maxwell_rate)}

    @on("maxwell-element", "J. C. Maxwell, Phil. Trans. R. Soc. 157 (1867) 49", states=spring)
    def maxwell_force(maxwell, *, size=on.once("stiffness", unit, reach), settling=settles):
        """A spring and a damper in series: rubber, a mount."""
        return size * maxwell


def _attached(on: _Shelf, displacement: _Usual, velocity: _Usual) -> None:
    _, reach, unit = displacement
    omega = velocity.size / reach
    usual = _Usual("", omega / (2 * np.pi), "Hz")
    own_mass = on.once("mass", f"({velocity.unit}/s)", 10 * velocity.size * omega)
    natural = usual.part("natural frequency", 1, 0.2, 5, 0.01, 50)
    damped = Parameter(0.03, min=0.001, max=0.3, lower=0, upper=2, doc="damping ratio")

    def tuned_x_rate(tuned_v):
        return tuned_v

    def tuned_v_rate(x, v, tuned_x, tuned_v, tuned, ratio):
        own = 2 * np.pi * tuned
        return own * own * (x - tuned_x) + 2 * ratio * own * (v - tuned_v)

    mass = {
        "tuned_x": State(unit, rate=tuned_x_rate),
        "tuned_v": State(velocity.unit, rate=tuned_v_rate),
    }

    @on("tuned-mass", "H. Frahm, US patent 989958, 1911", states=mass)
    def tuned_mass(x, v, tuned_x, tuned_v, *, size=own_mass, tuned=natural, ratio=damped):
        """A small mass on a spring that is fastened to it."""
        own = 2 * np.pi * tuned
        return size * (own * own * (x - tuned_x) + 2 * ratio * own * (v - tuned_v))

    f = usual.part("", 1, 0.1, 10, 0.01, 100)

    @on("tone", "J. P. Den Hartog, Mechanical Vibrations, 1934", "sine")
    def tone(time, *, size=on.either("cosine"), sine=on.either("sine"), frequency=f):
        """A tone from elsewhere: unbalance, hum."""
        return size * np.cos(2 * np.pi * frequency * time) + sine * np.sin(2 * np.pi * frequency * time)

    cosines, sines = (on.either(name, unit, reach) for name in ("cosine", "sine"))
    twice = usual.part("", 2, 0.2, 10, 0.01, 100)

    @on("pulsing-stiffness", "É. Mathieu, J. Math. Pures Appl. 13 (1868) 137", "sine")
    def parametric(x, time, *, size=cosines, sine=sines, frequency=twice):
        """A stiffness that pulses with time, as of teeth in mesh."""
        return x * (size * np.cos(2 * np.pi * frequency * time) + sine * np.sin(2 * np.pi * frequency * time))


@_of_recordings("of", measured="_measured")
def sensor(of: Named, *, input: str = "", late: float = 1e-3, prefix: str = "") -> Effects:
    """Faults of the sensor and its amplifier, on what is measured of a state or quantity.

    Parameters
    ----------
    of : name or (name, size, unit)
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
    name = of[0]
    reads = {"value": f"{name}_at_sensor", "given": input}
    on = _Shelf((f"{name}_measured", *of[1:]), reads, prefix or f"{name}-", instrument=True)
    _channel(on, late)
    if input:
        through = Parameter(0.01, min=-0.1, max=0.1, lower=-10, upper=10, doc="per unit of the input")

        @on("crosstalk", "IEC 61672-1:2013, 5.19")
        def leaks(given, *, size=through):
            """The input leaks into the channel."""
            return size * given

    return on.effects


@_of_recordings("of")
def actuator(of: Named, *, late: float = 1e-3, prefix: str = "") -> Effects:
    """Faults of an input: of what drives it, or of how it is measured.

    Parameters
    ----------
    of : name or (name, size, unit)
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
    on = _Shelf(of, {"value": f"{of[0]}_channel"}, prefix or f"{of[0]}-", instrument=True)
    _channel(on, late)
    tao = "G. Tao, P. V. Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, 1996"

    @on("dead-band", tao)
    def dead(value, *, size=on.of.part("", 0.05, 0.005, 0.5, 0, 2)):
        """Small inputs do nothing."""
        return -np.minimum(np.maximum(value, -size), size)

    return on.effects


def _between_samples(time: Any, value: Any) -> PPoly:
    """Cubics through the samples of a channel, which may be infinite."""
    slopes, change, step = as_cubics(value)[1], np.diff(value), time[1] - time[0]
    here, there = slopes[:-1], slopes[1:]
    parts = here + there - 2 * change, 3 * change - 2 * here - there, here, value[:-1]
    return PPoly([part / step**power for power, part in zip((3, 2, 1, 0), parts, strict=True)], time)


def _channel(on: _Shelf, late: float) -> None:
    """What may be wrong with a channel; `value` is what it should show."""
    usual, of_time = on.of.size, _Usual("", late, "s")
    a_little = Parameter(0.02, min=-0.1, max=0.1, lower=-0.9, upper=10, doc="share")

    @on("gain", GUIDE, adds_to=(), scales=on.of.name)
    def gain(time, *, size=a_little):
        """The sensitivity is off."""
        return (1 + size) * time**0

    @on("zero", GUIDE)
    def zero(time, *, size=on.either("offset")):
        """The zero is off."""
        return size * time**0

    @on("zero-drift", GUIDE)
    def drift(time, *, size=on.either("offset per second", "s", 10.0)):
        """The zero drifts."""
        return size * time

    @on("delay", OPPENHEIM)
    def delay(value, time, *, size=of_time.part("delay", 1, 0.05, 20, 0, 1e3)):
        """The channel is late."""
        if np.size(time) < 2:  # nothing came before
            return value - value
        return _between_samples(time, value)(np.maximum(time - size, np.min(time))) - value

    @on("lag", OPPENHEIM)
    def lag(value, time, *, size=of_time.part("time constant", 1, 0.05, 20, 0, 1e3)):
        """A filter of first order, as of a slow sensor or amplifier."""
        if np.size(time) < 2:
            return value - value
        cubics, slow = _between_samples(time, value), max(float(size), 1e-12)
        step, parts = cubics.x[1] - cubics.x[0], cubics.c[::-1]
        # what follows a cubic without a start of its own: y + slow dy/dt is the cubic
        for power in (2, 1, 0):
            parts[power] -= (power + 1) * slow * parts[power + 1]
        kept = np.exp(-step / slow)
        grown = step ** np.arange(4) @ parts - kept * parts[0]
        return lfilter([1.0], [1, -kept], np.append(np.ravel(value)[:1], grown))[: np.size(value)] - value

    @on("bend", GUIDE)
    def square(value, *, size=on.either("part at the usual size")):
        """The characteristic bends, alike to both sides."""
        return size * (value / usual) ** 2

    @on("saturation", GUIDE)
    def cube(value, *, size=on.either("part at the usual size")):
        """The characteristic bends: it begins to saturate."""
        return size * (value / usual) ** 3


@_of_recordings("outflow", "level")
def tank(outflow: Named, level: Named, *, prefix: str = "") -> Effects:
    """What else leaves a vessel, added to its outflow.

    Parameters
    ----------
    outflow, level : name or (name, size, unit)
        The quantity that is added to, and the state that drives it.
    prefix : str
        Before each name.

    Examples
    --------
    >>> [one.name for one in tank(outflow=("out", 1, "V/s"), level=("level", 5, "V"))]
    ['overflow', 'leak', 'laminar-outflow', 'constant-outflow']
    """
    on = _Shelf(outflow, {"level": level[0]}, prefix, level)
    _, high, _ = level
    height = _Usual(*level).part("level of the brim", 1, 0.3, 3, 0)

    @on("overflow", "ISO 1438:2017 (weirs)")
    def overflow(level, *, size=on.once("flow at one usual level above", by=OVER), brim=height):
        """Above its brim a vessel overflows."""
        return size * (np.maximum(level - brim, 0.0) / high) ** 1.5

    @on("leak", "E. Torricelli, De motu gravium, 1644")
    def leak(level, *, size=on.either("flow at the usual level")):
        """An opening whose flow goes with the root of the level."""
        return size * np.sqrt(np.maximum(level, 0.0) / high)

    @on("laminar-outflow", "G. Hagen, Ann. Phys. 46 (1839) 423")
    def laminar(level, *, size=on.either("flow at the usual level")):
        """Flow through a narrow tube, in proportion to the level."""
        return size * level / high

    @on("constant-outflow", "ISO 4006:1991")
    def constant(level, *, size=on.either("flow")):
        """A pump, or evaporation."""
        return size * level**0

    return on.effects
