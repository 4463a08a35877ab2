"""Effects of the flanks of worm and wheel: the coefficient of friction and what it depends on."""

import numpy as np

from specan.models import Parameter, effect
from specan.worm_gear.model.effects.oil import REFERENCE_VISCOSITY, SUPPLY
from specan.worm_gear.model.power import power_step

REFERENCE_LOAD = 4e4  # N/m: 45 N*m on a wheel of 90 mm and 25 mm width
NO_LOAD = 0.02  # of the reference load: keeps the law finite where the flanks hardly touch
FILM = 0.67  # power of speed and viscosity in the thickness of a film (Hamrock and Dowson 1977)


@effect(
    "tooth-friction",
    adds_to="friction_coefficient",
    aliases=("torque-gain-error",),
    reference="ISO/TS 14521:2020: mean coefficients of friction of 0.02 to 0.1 for bronze on steel",
)
def tooth_friction(*, mu=Parameter(0.05, "1", min=0.01, max=0.12, lower=0.0, upper=0.6, doc="coefficient")):
    """The flanks of a worm gear slide along each other much faster than they roll.

    A coefficient of friction that does not depend on load, speed or oil gives a loss proportional to the
    torque. Each dependence is a separate effect: speed-, viscosity-, load-dependent friction.
    """
    return mu


@effect(
    "speed-dependent-friction",
    adds_to="friction_coefficient",
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


@effect(
    "viscosity-dependent-friction",
    adds_to="friction_coefficient",
    valid={"friction_coefficient": (0.0, 1.0, "1")},
    separate_by="cold and warm oil at high torque, and again at low torque",
    reference="ISO/TR 14179-2:2001 and Schlenk: mu ~ eta^-0.05 for cylindrical gears; worm gears with their "
    "pure sliding show more (Predki 1982); the size is left free here",
)
def viscosity_dependent_friction(
    kinematic_viscosity,
    *,
    change=Parameter(
        0.003, "1", min=0.0005, max=0.015, lower=-0.1, upper=0.1, doc="of mu, from 100 to 50 mm^2/s"
    ),
    exponent=Parameter(
        0.15, "1", min=0.0, max=1.0, lower=-1.0, upper=2.0, doc="of the viscosity's power", fixed=True
    ),
):
    """Thick oil keeps the flanks further apart: friction rises as the oil thins, mu ~ nu^-s.

    The residual is proportional to the torque and changes its sign at some temperature in the middle: with
    warm oil the
    gear loses more under load than the model says, with cold oil less.
    """
    return change * power_step(REFERENCE_VISCOSITY / kinematic_viscosity, exponent)


@effect(
    "load-dependent-friction",
    adds_to="friction_coefficient",
    valid={"friction_coefficient": (0.0, 1.0, "1")},
    separate_by="torque over a decade at one speed and temperature",
    reference="exponents: 0.2 for steel gears (Schlenk, in ISO/TR 14179-2:2001); of an elastohydrodynamic film at "
    "most that of the Hertz pressure, 1.03, which is load^0.5 on a line, and less as the film heats (Xu, "
    "dissertation, Ohio State University, 2005); hydrodynamic -0.5, at a constant film -1 (Cameron, Basic "
    "Lubrication Theory, 1981); worm gears: minor (AGMA 98FTM10). Size and exponent are left free here",
)
def load_dependent_friction(
    tooth_load,
    *,
    change=Parameter(0.005, "1", min=-0.03, max=0.02, lower=-0.2, upper=0.2, doc="of mu, from 40 to 80 kN/m"),
    exponent=Parameter(0.2, "1", min=-1.0, max=0.5, lower=-2.0, upper=4.0, doc="of the load's power"),
):
    """A higher load on the flanks makes the oil film thinner (friction rises) or more effective (friction falls).

    mu = mu_0 + c ((x^a - 1)/(2^a - 1)) with x the load over 40 kN/m: the power law mu ~ (F/b)^a beside a share
    that does not depend on the load. The loss over torque is curved, which a constant coefficient of friction
    cannot cause. No
    film makes friction rise as fast as the load itself: where the data support an exponent
    above 0.5 by more than its uncertainty, another effect is likely whose loss is a power of the torque (a collar, a
    twisted housing).
    """
    return change * power_step(np.hypot(tooth_load / REFERENCE_LOAD, NO_LOAD), exponent)


@effect(
    "mesh-starvation",
    adds_to="friction_coefficient",
    separate_by="a higher oil level, or a jet of oil on the mesh, at high speed and torque",
    reference="film of a starved contact, h = h_full / (1 + (h_full/h_supplied)^g)^(1/g) (Chevalier, Lubrecht, Cann, "
    "Dalmaz 1998, J. Tribol. 120:126), h_full ~ (nu v)^0.67, the share that lacks is carried by the flanks; "
    "h_supplied constant, or what a disc holds after a turn, ~ (nu/omega)^0.5 (Emslie, Bonner, Peck 1958, "
    "J. Appl. Phys. 29:858)",
)
def mesh_starvation(
    sliding_speed,
    kinematic_viscosity,
    oil_level,
    *,
    rise=Parameter(
        0.03, "1", min=0.003, max=0.15, lower=0.0, upper=0.6, doc="friction of dry flanks, less that with oil"
    ),
    speed=Parameter(
        5.0, "m/s", min=0.5, max=20.0, lower=0.05, upper=100.0,
        doc="at which, with 100 mm^2/s, a full film would be as thick as the oil supplied",
    ),
    thrown_off=Parameter(
        0.25, "1", min=0.0, max=0.5, lower=0.0, upper=1.0,
        doc="power of speed over viscosity with which the supplied film thins: 0 constant, 0.5 thrown off in a turn",
    ),
    sharpness=Parameter(3.0, "1", min=2.0, max=5.0, lower=1.0, upper=10.0, doc="g of the transition", fixed=True),
    level_exponent=SUPPLY,
):  # fmt: skip
    """The worm throws off the oil that the next tooth needs.

    The film between the flanks cannot become thicker than the oil that comes back in time. Friction then
    rises with speed instead of falling: an extra loss at high speed, in proportion to the torque. Where a full
    film lacks supply, thick oil starves first; what is thrown off is more of thin oil, and then the oil hardly
    matters.
    """
    supplied = oil_level**level_exponent
    faster, thicker = sliding_speed / speed, kinematic_viscosity / REFERENCE_VISCOSITY
    full = faster ** (FILM + thrown_off) * thicker ** (FILM - thrown_off) / supplied
    share = (1.0 + full**sharpness) ** (-1.0 / sharpness)
    return rise * (1.0 - share)


@effect(
    "running-in",
    adds_to=("friction_coefficient", "no_load_loss"),
    neutral={"friction": 0.0, "drag": 0.0},
    needs=("elapsed_time",),
    aliases=("zero-drift",),
    separate_by="randomise the order of the measurements and repeat one reference point all along",
    reference="exponential approach of a wear process to its steady state (Niemann and Winter, "
    "Maschinenelemente III, on the running-in of worm gears); sizes and time are left free here",
)
def running_in(
    elapsed_time,
    worm_speed,
    *,
    friction=Parameter(
        0.005, "1", min=0.0, max=0.05, lower=-0.1, upper=0.3, doc="more of it between new flanks"
    ),
    drag=Parameter(0.02, "N*m", min=0.0, max=0.3, lower=-1.0, upper=5.0, doc="of seals at the start"),
    time=Parameter(5.0, "hour", min=0.2, max=100.0, lower=0.05, upper=500.0, doc="in which 63 % is gone"),
):
    """The bronze flanks of a new wheel adapt to the worm and the seal lips to the shaft: losses fall with time.

    The residual depends on time and not on torque, speed or temperature. If the conditions were run in
    order, it can look like any effect.
    """
    left = np.exp(-elapsed_time / time)
    return {"friction_coefficient": friction * left, "no_load_loss": drag * left * worm_speed}
