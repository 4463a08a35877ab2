"""Friction that falls as the flanks slide faster."""

from specan.models import Parameter, effect


@effect(
    "speed-dependent-friction",
    adds_to="friction_coefficient",
    neutral={"rise": 0.0},
    valid={"sliding_speed": (0.0005, 25.0, "m/s")},
    separate_by="low speeds at high torque, on a full grid of torque and speed",
    reference="the form of ISO/TS 14521:2020 / DIN 3996, mu_0T = a + b/(v_g + v_0)^c with c about 1; for "
    "polyglycols b/v_0 = 0.1 and v_0 = 0.2 m/s; grease and boundary films: Stribeck velocities from 1 mm/s "
    "(Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30:1083); both are left free here",
)
def speed_dependent_friction(
    sliding_speed,
    *,
    rise=Parameter(
        0.03, "1", min=0.003, max=0.15, lower=0.0, upper=0.6, doc="friction at rest, less that at high speed"
    ),
    speed=Parameter(
        0.5,
        "m/s",
        min=0.001,
        max=2.0,
        lower=0.0005,
        upper=5.0,
        doc="sliding speed at which half of it is gone",
    ),
):
    """A film of oil builds up between the flanks as they slide faster, and friction falls (Stribeck's curve).

    mu = mu_fast + rise / (1 + v/v_0): the loss is proportional to the torque and grows less than the speed; the
    trace is an extra loss at low speed and high torque.
    """
    return rise / (1.0 + sliding_speed / speed)
