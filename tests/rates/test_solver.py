"""States of models of rates against closed forms and scipy's integrators."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from specan import shelf
from specan.models import Model, Parameter, Signal, State, effect, march


def spring(x, stiffness):
    return stiffness * x


def damper(v, damping):
    return damping * v


def dx(v):
    return v


def dv(force, spring, damper, mass):
    return (force - spring - damper) / mass


@effect("cubic-spring", adds_to="spring", neutral={"size": 0.0})
def cubic_spring(x, *, size=Parameter(1e6, "N/m^3", min=1e4, max=1e9, lower=-1e10, upper=1e10)):
    """A spring that hardens."""
    return size * x**3


def creep_rate(x, creep, pace):
    return pace * (x - creep)


SHARE = Parameter(2e3, "N/m", min=100, max=1e4, lower=0)
PACE = Parameter(3.0, "1/s", min=0.1, max=50)


@effect("creep", adds_to="spring", neutral={"share": 0.0}, states={"creep": State("m", rate=creep_rate)})
def creeping(creep, *, share=SHARE, pace=PACE):
    """A spring in parallel that follows late."""
    return share * creep


def oscillator(effects=(), start=0.0, damping=20.0, noise=0.01):
    return Model.from_rates(
        dx, dv, spring, damper, states={"x": State("m", start=start), "v": State("m/s")}, inputs={"force": "N"},
        observables={"x": Signal("mm", noise)},
        parameters={"stiffness": (1e4, 1e3, 1e5, "N/m"), "mass": (1.0, 0.1, 10, "kg"),
            "damping": (damping, 0, 1e6, "N*s/m")},
        units={"spring": "N", "damper": "N"}, effects=effects,
    )  # fmt: skip


def response(model, time, force, values=None, effects=()):
    found = model.assemble(effects).evaluate({"time": time, "force_channel": force}, values)
    return found["x_measured"]


@pytest.fixture(params=["numba", "numpy"])
def way(request, monkeypatch):
    if request.param == "numpy":
        monkeypatch.setattr(march, "_numba", lambda: None)
    else:
        pytest.importorskip("numba")
    return request.param


TIME = np.arange(800) / 2000


def push(t):
    """A force in N."""
    return 60 * np.sin(2 * np.pi * 12 * t + 40 * t**2)


def test_an_input_of_few_samples_a_period():
    """A tone of ten samples a period, in closed form from rest; straight lines lose 3 % of it, plain cubics 0.03 %."""
    clock, omega, natural, decay = np.arange(400) / 500, 2 * np.pi * 50, np.sqrt(1e4), 10.0
    steady = 40 / (natural**2 - omega**2 + 2j * decay * omega)  # of exp(i omega t), kg
    damped = np.sqrt(natural**2 - decay**2)
    start, pace = -steady.imag, -(1j * omega * steady).imag
    free = np.exp(-decay * clock) * (
        start * np.cos(damped * clock) + (pace + decay * start) / damped * np.sin(damped * clock)
    )
    expected = 1e3 * ((steady * np.exp(1j * omega * clock)).imag + free)
    found = response(oscillator(noise=1e-6), clock, 40 * np.sin(omega * clock))
    assert np.sqrt(np.mean((found - expected) ** 2)) < 3e-4 * np.std(expected)


def test_free_decay_in_closed_form(way):
    """1/omega_d exp(-d t) sin: of a start away from rest, without a force."""
    decay, omega = 10.0, np.sqrt(1e4 - 100.0)
    expected = 2.0 * np.exp(-decay * TIME) * (np.cos(omega * TIME) + decay / omega * np.sin(omega * TIME))
    found = response(oscillator(start=2e-3), TIME, np.zeros(TIME.size))
    assert np.max(np.abs(found - expected)) < 1e-3  # a tenth of the noise


def test_nonlinear_with_a_state_of_an_effect(way):
    """Against scipy's DOP853 at 1e-10, the input in closed form."""
    force = push(TIME)

    def rates(t, s):
        x, v, c = s
        pull = 1e4 * x + 4e6 * x**3 + 5e3 * c
        return [v, push(t) - pull - 20 * v, 7.0 * (x - c)]

    truth = solve_ivp(
        rates, (0, TIME[-1]), [0, 0, 0], "DOP853", TIME, rtol=1e-10, atol=1e-13, max_step=1 / 2000
    )
    found = response(
        oscillator([cubic_spring, creeping]), TIME, force,
        {"cubic-spring.size": 4e6, "creep.share": 5e3, "creep.pace": 7.0}, ["cubic-spring", "creep"],
    )  # fmt: skip
    assert np.max(np.abs(found - 1e3 * truth.y[0])) < 1e-3
    assert 1 < np.max(np.abs(found)) < 100


@pytest.mark.long
def test_a_state_that_gets_stiff_in_a_fit(way):
    """Bristles that slip after a fiftieth of what they do by default, at the steps of that: scipy's LSODA at 1e-9."""
    slip, speed = 6e-5, 0.4
    lugre = [
        e for e in shelf.mechanics(force=("spring", 60, "N"), x=("x", 6e-3, "m"), v=("v", speed, "m/s"))
        if e.name == "lugre-friction"
    ]  # fmt: skip
    model, values = oscillator(lugre), {"lugre-friction.size": 3.0, "lugre-friction.rise": 0.7}
    response(model, TIME, push(TIME), values, ["lugre-friction"])
    found = response(model, TIME, push(TIME), {**values, "lugre-friction.slip": slip}, ["lugre-friction"])
    slow = lugre[0].parameters["slow"].default

    def rates(t, s):
        x, v, z = s
        slides = slip * (1 + 0.7 * np.exp(-((v / slow) ** 2)))
        return [v, push(t) - 1e4 * x - 20 * v - 3.0 * z / slip, v - abs(v) * z / slides]

    truth = solve_ivp(rates, (0, TIME[-1]), [0, 0, 0], "LSODA", TIME, rtol=1e-9, atol=1e-13).y[0]
    assert np.max(np.abs(found - 1e3 * truth)) < 2e-3
    assert {steps for _, steps in model.solver.steps.values()} <= {1, 2}


def test_steps_are_no_finer_than_a_quick_state_asks_for(monkeypatch):
    """Bristles that slide: their slope is next to nothing, and its changes in a step come from the speed.

    A step is halved while |h df/ds| is above 1, and 2 samples of 20 have a corner, where the speed turns round.
    """
    monkeypatch.setattr(march, "_numba", lambda: None)
    slip, time, speeds = 6e-5, TIME[:180], []

    def rate(v, bristle):
        speeds.append(float(v[0]))
        return v - np.abs(v) * bristle / slip

    @effect("dahl", adds_to="spring", neutral={"size": 0.0}, states={"bristle": State("m", rate=rate)})
    def dahl(bristle, *, size=Parameter(3.0, "N", min=0.1, max=10, lower=0)):
        """Friction whose contacts bend."""
        return size * bristle / slip

    model = oscillator([dahl])
    response(model, time, push(time), {}, ["dahl"])
    taken = len(speeds) / 4 / time.size / 3  # marches: two to see that the steps are enough
    asked = np.mean(2 ** np.ceil(np.log2(np.maximum(np.abs(speeds) * time[1] / slip, 1))))
    assert taken < asked


def test_stiff_system_takes_the_implicit_method(way):
    """An overdamped one whose fast root is far beyond what Runge-Kutta can take: closed form of the slow one."""
    model = oscillator(start=1e-3, damping=1e6)
    found = response(model, TIME, np.zeros(TIME.size))
    slow = (-1e6 + np.sqrt(1e12 - 4e4)) / 2
    assert np.max(np.abs(found - np.exp(slow * TIME))) < 1e-3
    assert "stiff" in model.solver.method()


@pytest.mark.long
@pytest.mark.parametrize(
    ("damping", "method", "broken"), [(20.0, "explicit", True), (1e6, "implicit", False)]
)
def test_machine_code_is_kept_and_where_it_is_broken_made_anew(
    tmp_path, monkeypatch, damping, method, broken
):
    """Both methods: the next program takes up what this one compiled, and gives the same."""
    pytest.importorskip("numba")
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path))
    found, hits = [], []
    for _ in range(2):
        monkeypatch.setattr(march, "_COMPILED", {})
        model = oscillator(start=1e-3, damping=damping)
        found.append(response(model, TIME, np.zeros(TIME.size)))
        program = model.solver.program(model.assemble())
        hits.append(sum(program.march(method).stats.cache_hits.values()))
        for kept in tmp_path.rglob("*.nbi") if broken else ():
            kept.write_bytes(b"cut off")
    assert np.array_equal(*found)
    assert hits == [0, 0 if broken else 1]


def test_effects_that_are_off_change_nothing(way):
    force = 30 * np.cos(2 * np.pi * 15 * TIME)
    plain = response(oscillator(), TIME, force)
    assert np.allclose(response(oscillator([cubic_spring, creeping]), TIME, force), plain, rtol=1e-12, atol=0)
    neutral = {"cubic-spring.size": 0.0, "creep.share": 0.0}
    model = oscillator([cubic_spring, creeping])
    assert np.allclose(
        response(model, TIME, force, neutral, ["cubic-spring", "creep"]), plain, rtol=1e-6, atol=1e-6
    )


SIZE, PLACE = Parameter(1e5, "N/m", min=1e3, max=1e6, lower=0), Parameter(1e-3, "m", min=-0.01, max=0.01)


@effect("stop", adds_to="spring", neutral={"size": 0.0})
def stop(x, *, size=SIZE, place=PLACE):
    """A stop on the positive side."""
    return size * np.maximum(x - place, 0.0)


@effect("play", adds_to="spring", neutral={"size": 0.0})
def play(x, *, size=SIZE, place=PLACE):
    """A stiffness that does not act within a gap."""
    return -size * np.clip(x, -place, place)


def with_events(pull, edges):
    """Displacement in mm by scipy, begun anew at every edge at which the pull bends, and at every sample."""
    events = [lambda t, s, edge=edge: s[0] - edge for edge in edges]
    for event in events:
        event.terminal = True
    state, found = np.zeros(2), [0.0]
    for k in range(TIME.size - 1):
        now, end = TIME[k], TIME[k + 1]
        while now < end:

            def rates(t, s):
                return [s[1], push(t) - 1e4 * s[0] - pull(s[0]) - 20 * s[1]]

            done = solve_ivp(rates, (now, end), state, "DOP853", rtol=1e-11, atol=1e-14, events=events)
            now, state = done.t[-1], done.y[:, -1]
            if done.status == 1:  # over the edge, by a step of which the error is far below what is asked for
                state = state + 1e-9 * np.array(rates(now, state))
                now += 1e-9
        found.append(1e3 * state[0])
    return np.array(found)


@pytest.mark.long
@pytest.mark.parametrize(
    ("one", "edges", "pull"),
    [(stop, [1e-3], lambda x: 1e5 * max(x - 1e-3, 0.0)),
     (play, [-1e-3, 1e-3], lambda x: -8e3 * min(max(x, -1e-3), 1e-3))],
)  # fmt: skip
def test_steps_across_a_corner_err_less_than_a_tenth_of_the_noise(way, one, edges, pull):
    """A stop that is met, and play of a joint, against scipy that stops at each event."""
    force = push(TIME)
    size = {"stop": 1e5, "play": 8e3}[one.name]
    found = response(oscillator([one]), TIME, force, {f"{one.name}.size": size}, [one.name])
    truth = with_events(pull, edges)
    assert np.sqrt(np.mean((found - truth) ** 2)) < 1e-3
    assert np.max(np.abs(truth)) > 2


@pytest.mark.long
def test_what_cannot_be_compiled_is_said_with_the_name_of_its_function():
    """numpy's selection of lists is unknown to numba; limits and steps of single numbers are told to it."""
    pytest.importorskip("numba")

    @effect("rattle", adds_to="spring", neutral={"size": 0.0})
    def rattle(x, *, size=SIZE):
        return size * np.select([x > 0], [x], 0.0)

    @effect("step", adds_to="spring", neutral={"size": 0.0})
    def step(x, *, size=SIZE):
        return size * np.clip(x, 0.0, 1.0)

    said = []
    for effects in ([step], [step, rattle]):
        model = oscillator(effects)
        response(model, TIME[:10], np.zeros(10))
        said.append(model.solver.method())
    assert said[0] == "Runge-Kutta, at least 1 step per sample"
    assert "numba cannot compile rattle (" in said[1]


@pytest.mark.parametrize(("shift", "count"), [(6e-4, 200), (6e-5, 1200)])
def test_dry_friction_turns_round_within_a_sample(shift: float, count: int) -> None:
    """Released from rest a mass swings in half waves about places that friction shifts (Coulomb 1785)."""

    def dv(spring, mass):
        return -spring / mass

    omega, amplitude = 100.0, 5e-3  # rad/s, m; `shift` is friction over stiffness
    effects = shelf.mechanics(force=("spring", 50, "N"), x=("x", 5e-3, "m"), v=("v", 0.5, "m/s"))
    model = Model.from_rates(
        dx, dv, spring, states={"x": State("m", start=amplitude), "v": State("m/s")}, inputs={},
        observables={"x": Signal("m", 5e-5)}, units={"spring": "N"},
        parameters={"stiffness": (1e4, 1e3, 1e5, "N/m"), "mass": (1.0, 0.1, 10, "kg")},
        effects=[one for one in effects if one.name == "dry-friction"],
    )  # fmt: skip
    time = np.arange(count) / 1000
    found = model.assemble(["dry-friction"]).evaluate(
        {"time": time}, {"dry-friction.size": shift * omega**2}, ["x_measured"]
    )
    half = time * omega // np.pi
    width = amplitude - (2 * half + 1) * shift
    known = (-1.0) ** half * (shift + width * np.cos(time * omega - half * np.pi))
    error = np.asarray(found["x_measured"]) - known
    assert np.std(error[width > 0]) < 1.2e-6
    assert model.solver.method() == "Runge-Kutta, at least 1 step per sample"


def test_what_is_switched_does_nothing_before_and_overshoots_nothing_after(way):
    """The integral of a step between two samples: zero, then a straight line from half way."""

    def dx(u):
        return u

    model = Model.from_rates(
        dx, states={"x": State("m")}, inputs={"u": "m/s"}, observables={"x": Signal("m", 1e-9)}
    )
    time = np.arange(40.0)
    found = model.assemble().evaluate({"time": time, "u_channel": (time > 19.5) * 1.0})
    assert np.allclose(found["x_measured"], np.maximum(time - 19.5, 0), rtol=0, atol=1e-12)
