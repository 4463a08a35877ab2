"""Every effect keeps the rules of effects, and its trace lies where tooth numbers say."""

import time

import numpy as np
import pytest

from specan.models.catalogue import example_model, load_model
from specan.models.check import check_effect
from specan.planetary_gear.model.kinematics import line_conditions
from specan.planetary_gear.model.response import parting, without_pull
from specan.planetary_gear.model.rig import EXAMPLE_RIG

MODEL = example_model("planetary-gear")
ORDERS = line_conditions(MODEL)


def evaluate(*uses: str, model=MODEL, **conditions):
    given = {**ORDERS, **conditions}
    assembly = model.assemble(uses)
    return assembly.evaluate(given, wanted=["order_lines"])["order_lines"]


def strength(lines) -> dict[float, float]:
    """Strength of each line of the first sensor over the strongest one."""
    size = np.abs(lines[0])
    return dict(zip(np.round(ORDERS["order"], 4).tolist(), (size / size.max()).tolist()))


@pytest.mark.parametrize("name", sorted(MODEL.effects))
def test_every_effect_keeps_the_rules(name):
    given = dict(ORDERS)
    if name in (
        "carrier-runout",
        "sun-runout",
    ):  # at a torque at which no teeth part: a fit over it may miss a size
        given["carrier_torque"] = np.full(ORDERS["order"].size, 300.0)
    check_effect(MODEL.effects[name], MODEL, given)


def test_all_effects_of_the_catalogue_are_there():
    assert set(MODEL.effects) == {
        "transmission-path", "unequal-load-sharing", "planet-position-error", "carrier-runout", "sun-runout",
        "planet-runout", "pitch-errors", "tooth-crack", "mesh-damping", "ring-flexibility", "backlash", "tip-relief",
        "torque-ripple", "speed-fluctuation", "tooth-friction", "housing-resonance", "shaft-flexibility",
        "tacho-angle",
    }  # fmt: skip
    for effect in MODEL.effects.values():
        assert effect.reference
        assert effect.separate_by
        assert len(effect.explanation) > 60


def test_the_ideal_set_shows_66h_and_3k_only():
    found = strength(evaluate())
    for order, size in found.items():
        offset = order - 66 * max(1, round(order / 66))
        if offset in (-3, 0, 3):
            assert size > 1e-6
        else:
            assert size < 1e-10


# effect -> offsets from a mesh harmonic at which lines appear that the ideal set has not
TRACES = {
    "unequal-load-sharing@P1": {1, 2},
    "planet-position-error@P1": {1, 2},
    "sun-runout": {3.75, 0.75},
    "planet-runout@P1": {66 / 21 - 1, 66 / 21 + 1},
    "pitch-errors": {7.5, 4.5, 8.25},
    "torque-ripple": {3.75},
}


@pytest.mark.parametrize(("use", "offsets"), TRACES.items())
def test_a_trace_lies_where_the_teeth_say(use, offsets):
    """Linear in the meshes; a displaced load passes the sensor, so its sidebands lie at whole orders."""
    orders = np.concatenate([[66 - o, 66 + o] for o in offsets])
    given = {
        "order": orders,
        "sun_speed": np.full(orders.size, 30.0),
        "carrier_torque": np.full(orders.size, 60.0),
    }
    without = np.abs(evaluate(**given))
    with_it = np.abs(evaluate(use, **given))
    assert np.all(without < 1e-12)
    assert with_it.max() > 1e-6


@pytest.mark.parametrize(
    ("use", "turns", "above", "below"),
    [
        ("planet-position-error@P1", 1, 1.0, 1.0),
        ("sun-runout", 31, 101 / 31 - 1, 101 / 31),  # 101 -+ 1 passages are a multiple of three there
        ("planet-runout@P1", 35, 101 / 35 + 1, 101 / 35 + 1),
    ],
)
def test_teeth_that_meet_again_after_a_thousand_turns_have_the_lines_of_their_parts(use, turns, above, below):
    """35 * 31 turns of the carrier: an error comes back with the turns of its part, and only these are followed."""
    gear = {
        "z_sun": 31,
        "z_planet": 35,
        "z_ring": 101,
        "planets": 3,
        "module_mm": 2.0,
        "centre_distance_mm": 66.0,
    }
    model = load_model("planetary-gear", {**EXAMPLE_RIG, "gear": gear})
    given = {
        "order": np.array([101 + above, 101 - below, 101.5]),
        "sun_speed": np.full(3, 30.0),
        "carrier_torque": np.full(3, 60.0),
    }
    found = model.assemble([use]).evaluate(
        given, {}, wanted=["angles", "repeat_turns", "carrier_turn", "order_lines"]
    )
    assert found["repeat_turns"] == 1085
    assert found["angles"] == found["carrier_turn"].size // 1085 * turns
    lines = np.abs(found["order_lines"])
    assert lines[:, :2].max() > 1e-6
    assert lines[:, 2].max() < 1e-12


def linear_model():
    """Pairs of teeth that are linear springs, with a pin or a share that can be wrong."""
    rig = {**EXAMPLE_RIG, "contact": {"exponent": 1.0, "K_N_mm_e": 7e4, "C_Ns_mm": 0.0}}
    return load_model("planetary-gear", rig)


@pytest.mark.parametrize(
    ("use", "exponent"), [("planet-position-error@P1.error", -1.0), ("unequal-load-sharing@P1.share", 0.0)]
)
def test_position_errors_and_load_shares_part_over_torque(use, exponent):
    """Of linear springs: a pin moves by the same at every torque, so its lines beside the mesh fall with 1/torque.

    A stiffer planet carries the same part more at every torque.
    """
    model, value = linear_model(), 0.3e-6 if "error" in use else 0.1
    assembly = model.assemble([use.partition(".")[0]])
    orders = np.array([65.0, 66.0, 67.0, 131.0, 132.0])
    found = []
    for torque in (60.0, 120.0):
        given = {"order": orders, "sun_speed": np.full(5, 30.0), "carrier_torque": np.full(5, torque)}
        lines = assembly.evaluate(given, {use: value}, wanted=["order_lines"])["order_lines"][0]
        found.append(np.abs(lines / lines[[1, 1, 1, 4, 4]])[[0, 2, 3]])
    # gaps before and after the path of contact are closed by the load, which bends the law by some per cent
    assert found[1] / found[0] == pytest.approx(2.0**exponent, rel=0.08)


def test_a_stiffer_planet_carries_its_share_of_every_line():
    """F (1 + share) at all harmonics: a heavy carrier holds the approach, and forces go as the stiffness."""
    heavy = load_model("planetary-gear", {**EXAMPLE_RIG, "rotors": {"carrier_kg_m2": 10.0}})
    assembly = heavy.assemble(["unequal-load-sharing@P1"])
    values = {"unequal-load-sharing@P1.share": 0.1, "unequal-load-sharing@P1.pin": 0.0}
    force = assembly.evaluate(ORDERS, values, wanted=["mesh_force"])["mesh_force"][0, 1]
    mean = force.mean(axis=-1)
    assert mean[0] / mean[1] == pytest.approx(1.1, rel=1e-3)
    turns = np.fft.rfft(force, axis=-1)
    assert np.abs(turns[0, 66] / turns[1, 66]) == pytest.approx(1.1, rel=0.03)


def test_a_soft_pin_is_one_out_of_place_by_what_it_gives_way():
    """Its planet stands behind in proportion to the torque: at each torque as one whose pin is misplaced by so much."""
    model = linear_model()
    soft, misplaced = (model.assemble([f"{n}@P1"]) for n in ("unequal-load-sharing", "planet-position-error"))
    values = {"unequal-load-sharing@P1.share": -0.1, "unequal-load-sharing@P1.pin": 1.0}
    for torque in (60.0, 120.0):
        given = {
            "order": ORDERS["order"],
            "sun_speed": ORDERS["sun_speed"],
            "carrier_torque": np.full(ORDERS["order"].size, torque),
        }
        known = soft.evaluate(given, values, ["order_lines", "planet_load", "mean_load", "load_stiffness"])
        # three planets together hold the torque: each of the others takes a third of what it leaves
        assert known["planet_load"][0, 0] == pytest.approx((1 - 0.1 * 2 / 3) * known["mean_load"][0])
        behind = 0.1 * known["mean_load"] / (known["load_stiffness"] * np.cos(np.radians(20.0)))
        out = misplaced.evaluate(given, {"planet-position-error@P1.error": float(behind[0])}, ["order_lines"])
        assert known["order_lines"] == pytest.approx(out["order_lines"], rel=1e-9)


@pytest.mark.parametrize("use", ["", "planet-position-error@P2", "unequal-load-sharing@P2"])
def test_forces_of_periodic_springs_against_an_integration(use):
    """The same springs, deflections and dampers by the trapezoidal rule over a period that closes on itself."""
    values = {"planet-position-error@P2.error": 0.5e-6, "unequal-load-sharing@P2.share": 0.1}
    values = {name: value for name, value in values.items() if use and name.startswith(use)}
    wanted = ["mesh_force", "mesh_spring", "mesh_damping", "transmission_error", "planet_load", "planet_phase",
              "carrier_inertia", "planet_inertia", "base_radii"]  # fmt: skip
    given = {"order": np.full(1, 66.0), "sun_speed": np.full(1, 30.0), "carrier_torque": np.full(1, 60.0)}
    answer = MODEL.assemble([use] if use else []).evaluate(given, values, wanted)
    got = {name: np.asarray(answer[name]) for name in wanted}
    spring, damper = got["mesh_spring"][0].reshape(6, -1), got["mesh_damping"][0].ravel()
    steady = got["transmission_error"][0].reshape(6, -1)
    sun, planet, ring = got["base_radii"]
    geometry = np.zeros((6, 4))  # what carrier and planets take off each approach
    geometry[:3, 0], geometry[3:, 0] = sun + planet, ring - planet
    for i in range(3):
        geometry[i, 1 + i], geometry[3 + i, 1 + i] = planet, -planet
    mass = np.array([float(got["carrier_inertia"]), *[float(got["planet_inertia"])] * 3])
    steps, reach, hz = 128, 6, 66 * 8.0
    turn = np.exp(2j * np.pi * np.outer(np.arange(-reach, reach + 1), np.arange(steps)) / steps)
    number = np.arange(-reach, reach + 1)
    stiff = np.fft.fft(spring, axis=-1)[:, number] / spring.shape[1]
    k = ((stiff * np.exp(2j * np.pi * number * got["planet_phase"].ravel()[:, None])) @ turn).real
    e = (np.fft.fft(steady, axis=-1)[:, 66 * number] / steady.shape[1] @ turn).real
    e -= e.mean(axis=1, keepdims=True)

    # unknown: 4 angles and 4 speeds a step (speeds in units of omega), 6 offsets that hold the mean forces
    omega, h = 2 * np.pi * hz, 2 * np.pi / steps
    size = 8 * steps + 6
    force = np.zeros((steps, 6, size))
    known = np.zeros((steps, 6))
    for n in range(steps):
        force[n, :, 8 * n : 8 * n + 4] = -k[:, n, None] * geometry
        force[n, :, 8 * n + 4 : 8 * n + 8] = -omega * damper[:, None] * geometry
        force[n, :, -6:] = np.diag(k[:, n])
        known[n] = -k[:, n] * e[:, n]
    rate, source = np.zeros((steps, 8, size)), np.zeros((steps, 8))
    for n in range(steps):
        rate[n, :4, 8 * n + 4 : 8 * n + 8] = np.eye(4)
        rate[n, 4:] = (geometry / mass).T @ force[n] / omega**2
        source[n, 4:] = (geometry / mass).T @ known[n] / omega**2
    state = np.zeros((steps, 8, size))
    for n in range(steps):
        state[n, :, 8 * n : 8 * n + 8] = np.eye(8)
    rows = (np.roll(state, -1, axis=0) - state) / h - (np.roll(rate, -1, axis=0) + rate) / 2
    right = (np.roll(source, -1, axis=0) + source) / 2
    scale = k.mean()
    matrix = np.concatenate([rows.reshape(-1, size), force.mean(axis=0) / scale, state[:, :4].mean(axis=0)])
    wanted_values = np.concatenate([right.ravel(), -known.mean(axis=0) / scale, np.zeros(4)])
    solution = np.linalg.lstsq(matrix, wanted_values, rcond=None)[0]
    assert matrix @ solution == pytest.approx(wanted_values, abs=1e-6 * np.abs(wanted_values).max())
    expected = 2 * np.fft.rfft((force @ solution + known).T, axis=-1)[:, 1:4] / steps
    mesh = got["mesh_force"][0].reshape(6, -1)
    found = 2 * np.fft.rfft(mesh, axis=-1)[:, [66, 132, 198]] / mesh.shape[-1]
    assert mesh.mean(axis=-1) == pytest.approx(np.tile(got["planet_load"][0], 2), rel=1e-9)
    assert np.abs(found - expected).max() < 0.03 * np.abs(expected).max()


def test_a_resonance_stands_in_hertz():
    """Doubling the speed halves the order at which a line stands out."""
    orders = np.array([66.0, 132.0])
    slow = {"order": orders, "sun_speed": np.full(2, 31.25), "carrier_torque": np.full(2, 60.0)}
    gain = np.abs(evaluate("housing-resonance", **slow)[0] / evaluate(**slow)[0])
    assert gain[1] > 10 > 2 > gain[0]  # order 132 at 8.33 Hz is 1100 Hz
    fast = {**slow, "sun_speed": np.full(2, 62.5)}
    gain = np.abs(evaluate("housing-resonance", **fast)[0] / evaluate(**fast)[0])
    assert gain[0] > 10 > 2 > gain[1]


def test_twenty_families_in_a_fifth_of_a_second():
    everything = [f"{n}@{MODEL.axes[e.at][0]}" if e.at else n for n, e in MODEL.effects.items()]
    evaluate(*everything)
    begun = time.process_time()
    evaluate(*everything)
    assert time.process_time() - begun < 0.4  # 0.1 s alone on a machine; twice as much where it is shared


def test_the_order_domain_agrees_with_the_run_in_time():
    """Mesh forces of the ideal set, harmonic by harmonic, against the integration of the equations of motion."""
    from specan.planetary_gear.model.compiled import HAS_NUMBA

    if not HAS_NUMBA:
        pytest.skip("numba is not installed")
    from specan.planetary_gear.model.dynamics import simulate

    rig = MODEL.settings["parsed_rig"]
    motion = simulate(rig, 0.25)
    in_time = np.abs(np.fft.rfft(motion.ring_force[0]))[2 * 66 :: 2 * 66][:3] * 2 / motion.time.size
    assembly = MODEL.assemble([])
    force = assembly.evaluate(ORDERS, wanted=["mesh_force"])["mesh_force"][0, 1, 0]
    turns = round(
        force.size * float(MODEL.assemble([]).evaluate(ORDERS, wanted=["carrier_turn"])["carrier_turn"][1])
    )
    in_orders = np.abs(np.fft.rfft(force))[66 * turns :: 66 * turns][:3] * 2 / force.size
    print(in_time, in_orders)
    assert np.all(np.abs(in_time - in_orders) < 0.1 * in_time.max())


def test_a_set_out_of_phase_suppresses_its_mesh_order():
    rig = {
        **EXAMPLE_RIG,
        "gear": {"z_sun": 31, "z_planet": 31, "z_ring": 95, "planets": 3, "module_mm": 1.0, "centre_distance_mm": 31.5,
                 "contact_ratio_sun_planet": 1.5, "contact_ratio_ring_planet": 1.8},
    }  # fmt: skip
    model = load_model("planetary-gear", rig)
    orders = np.array([93.0, 94.0, 95.0, 96.0, 97.0])
    found = np.abs(
        evaluate(model=model, order=orders, sun_speed=np.full(5, 30.0), carrier_torque=np.full(5, 60.0))[0]
    )
    assert found[[1, 2, 4]].max() < 1e-9 * found.max()
    assert found[[0, 3]].min() > 1e-3 * found.max()


@pytest.mark.parametrize("error", [0.5e-6, 3e-6, 30e-6, -30e-6])
def test_planets_hold_the_torque_together(error):
    """Whatever pin lies ahead and whichever planet lifts off, the loads add up to the torque."""
    assembly = MODEL.assemble(["planet-position-error@P2"])
    found = assembly.evaluate(
        {"order": np.full(2, 66.0), "sun_speed": np.full(2, 30.0), "carrier_torque": np.array([10.0, 60.0])},
        {"planet-position-error@P2.error": error},
        wanted=["planet_load"],
    )["planet_load"]
    arm = 1e-3 * (24 + 66) * np.cos(np.radians(20))  # base radii of sun and ring
    assert found.sum(axis=1) == pytest.approx(np.array([10.0, 60.0]) / arm, rel=1e-12)
    assert np.all(found > 0)
    assert np.all((found[:, 1] < found[:, 0]) == (error > 0))


def test_inertias_that_are_known_are_taken():
    """What the rig file says of carrier, load and planets."""
    rig = {**EXAMPLE_RIG, "rotors": {"carrier_kg_m2": 2e-3, "load_kg_m2": 6e-3, "planet_kg_m2": 5e-5}}
    model = load_model("planetary-gear", rig)
    found = model.assemble([]).evaluate(ORDERS, None, ["carrier_inertia", "planet_inertia"])
    assert (found["carrier_inertia"], found["planet_inertia"]) == pytest.approx((8e-3, 5e-5))


@pytest.mark.parametrize("swing", [0.5, 0.9, 1.4])  # of the mean force, as a spring that pulls would have it
def test_a_mesh_that_parts_against_an_integration(swing):
    """One mass on a spring and a damper that push only, driven below its resonance, by Runge-Kutta's method."""
    from scipy.integrate import solve_ivp

    mass, stiffness, load, hz = 0.1, 2e8, 100.0, 1500.0
    drag, omega = 0.6 * np.sqrt(mass * stiffness), 2 * np.pi * hz
    line = stiffness / (1 - stiffness / (mass * omega**2) - 1j * drag / (mass * omega))
    driven = swing * load / abs(line)  # by this the flanks are pushed apart, cos(omega t)

    def dynamics(orders):
        turning = np.where(orders == 0, 1.0, omega * orders)
        return (
            stiffness * np.eye(orders.size, dtype=complex)[:, None, :],
            1j * omega * orders[:, None] * drag + 0j,
            np.stack(
                [1 / (mass * turning**2), 0 * turning], axis=-1
            ),  # of the mass, and of a wall that stands
        )

    first = -driven / 2 * stiffness / (1 - (stiffness + 1j * drag * omega) / (mass * omega**2))
    beyond = np.array([np.conj(first), 0.0, first])[:, None]
    added = parting(np.array([load]), beyond, np.array([[1.0, 1.0]]), dynamics)
    found = (beyond + added)[:, 0] + np.array([0.0, load, 0.0])

    def force(time, place, speed):
        return np.maximum(load + stiffness * (place - driven * np.cos(omega * time)) + drag * speed, 0.0)

    def slope(time, state):
        return [state[1], -(force(time, *state) - load) / mass]

    period = 1 / hz
    run = solve_ivp(slope, (0, 30 * period), [0.0, 0.0], rtol=1e-8, atol=1e-14, dense_output=True)
    at = (29 + np.arange(256) / 256) * period
    true = np.fft.fft(force(at, *run.sol(at))) / 256
    assert found[1].real == pytest.approx(load, rel=1e-9)
    assert found[2] == pytest.approx(true[1], abs=0.06 * abs(true[1]))
    assert (abs(added).max() > 0) == (abs(first) * 2 > load)


@pytest.mark.long
def test_lines_of_teeth_that_bounce_change_little_by_little():
    """At a light load the places that part never settle; five parts in a million of the inertia are no other line."""
    contact = {"K_N_mm_e": 2.25e5, "exponent": 1.255, "C_Ns_mm": 2335.0}
    order = np.tile([66.0, 63.0, 69.0, 132.0, 129.0, 135.0, 198.0], 2)
    at = {"order": order, "sun_speed": np.full(14, 33.9), "carrier_torque": np.repeat([26.0, 82.0], 7)}

    def lines(step):
        rotors = {"carrier_kg_m2": 7.69e-3 * np.exp(step), "planet_kg_m2": 5.884e-5}
        model = load_model("planetary-gear", {**EXAMPLE_RIG, "rotors": rotors, "contact": contact})
        return model.assemble(model.base_effects).evaluate(at, None, ["order_lines"])["order_lines"]

    found = np.stack([lines(step) for step in np.linspace(-1e-4, 1e-4, 41)])
    assert np.abs(np.diff(found, axis=0)).max() < 1e-3 * np.abs(found).max()


def test_a_soft_tooth_leaves_its_load_to_the_other_planets():
    """Turning slowly, planets are springs in parallel, each a sun and a ring mesh in series.

    Of constant springs, one sun mesh softer by the part s takes s / 3 off its planet's force, to first order, and the
    two others have half of that more; save where one pair of teeth takes over from another.
    """
    gear = {**EXAMPLE_RIG["gear"], "contact_ratio_sun_planet": 1.0, "contact_ratio_ring_planet": 1.0}
    model = load_model("planetary-gear", {"gear": gear, "contact": {"exponent": 1.0, "C_Ns_mm": 0.0}})
    at = {"order": np.full(1, 66.0), "sun_speed": np.full(1, 0.01), "carrier_torque": np.full(1, 60.0)}
    values = {"tooth-crack.softer": 0.03, "tooth-crack.place": 0.2}
    found = model.assemble(["tooth-crack"]).evaluate(at, values, ["mesh_force", "sun_softness", "mean_load"])
    change = found["mesh_force"][0] / found["mean_load"] - 1.0
    soft = found["sun_softness"][:, : change.shape[-1]]
    assert soft.max() == pytest.approx(0.03, rel=1e-3)
    expected = -0.5 * soft + soft.sum(axis=0) / 6
    off = (change[1] - expected) - (change[1] - expected).mean(axis=-1, keepdims=True)
    assert np.quantile(np.abs(off), 0.97) < 0.01 * 0.03
    assert np.abs(expected).max() == pytest.approx(0.01, rel=0.01)


def test_planets_that_part_leave_their_load_to_the_others():
    forces = np.array([[100.0, -30.0, 60.0], [100.0, 90.0, 60.0], [100.0, 90.0, -6.0]])  # planets by angles
    found = without_pull(forces)
    assert found[:, 0] == pytest.approx([100.0] * 3)
    assert found[:, 1] == pytest.approx([0.0, 75.0, 75.0])
    assert found[:, 2] == pytest.approx([57.0, 57.0, 0.0])
    assert without_pull(np.abs(forces)) == pytest.approx(np.abs(forces))


def test_an_uneven_sun_larger_than_the_deflection_lets_planets_go():
    """The planets that are pressed carry the torque alone: no force pulls, and the loads still add up to it."""
    given = {"order": np.full(1, 66.0), "sun_speed": np.full(1, 30.0), "carrier_torque": np.full(1, 10.0)}
    values = {"sun-runout.cosine": 5e-6, "sun-runout.sine": 0.0}
    force = MODEL.assemble(["sun-runout"]).evaluate(given, values, wanted=["mesh_force"])["mesh_force"][0]
    even = MODEL.assemble([]).evaluate(given, None, wanted=["mesh_force"])["mesh_force"][0]
    assert force.min() >= 0.0
    assert (force == 0.0).mean() > 0.1
    assert force[1].sum(axis=0).mean() == pytest.approx(even[1].sum(axis=0).mean(), rel=0.02)


OTHER_SETS = {
    "in phase": {},
    "sequentially phased": {"z_sun": 31, "z_planet": 31, "z_ring": 95, "module_mm": 1.0, "centre_distance_mm": 31.5},
    "counter-phased": {"z_sun": 26, "z_planet": 20, "z_ring": 66, "planets": 4},
}  # fmt: skip


@pytest.mark.parametrize("phasing", OTHER_SETS)
def test_an_eccentric_ring_changes_lines_of_the_ideal_set_alone(phasing):
    """By symmetry: after a passage each planet stands where the next one stood, and the ring is the same.

    Orders that are left are those at which exp(j n psi) adds up over the planets: multiples of their number.
    """
    gear = {**EXAMPLE_RIG["gear"], **OTHER_SETS[phasing]}
    model = load_model("planetary-gear", {**EXAMPLE_RIG, "gear": gear})
    assert phasing in model.title
    teeth, planets = gear["z_ring"], gear["planets"]
    orders = np.array([h * teeth + k for h in (1, 2) for k in range(-5, 6)], dtype=float)
    given = {"order": orders, "sun_speed": np.full(22, 30.0), "carrier_torque": np.full(22, 300.0)}
    small = {"carrier-runout.cosine": 2e-7, "carrier-runout.sine": 1e-7}
    assembly = model.assemble(["carrier-runout"])
    change = assembly.evaluate(given, small, ["order_lines"])["order_lines"] - evaluate(model=model, **given)
    size = np.abs(change[0]) / np.abs(change[0]).max()
    whole = orders % planets == 0
    assert np.all(size[~whole] < 1e-8)
    assert np.all(size[whole & (np.abs(orders - np.rint(orders / teeth) * teeth) < 4)] > 1e-6)
