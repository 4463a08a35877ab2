"""Errors of gears and carrier, which come back with every turn, and planets that do not carry alike."""

import numpy as np

from specan.models import Parameter, effect

COSINE = Parameter(10.0, "um", min=-30.0, max=30.0, lower=-500.0, upper=500.0, doc="part in phase")
SINE = Parameter(5.0, "um", min=-30.0, max=30.0, lower=-500.0, upper=500.0, doc="part in quadrature")


@effect(
    "sun-runout",
    adds_to="sun_error",
    neutral={"cosine": 0.0, "sine": 0.0},
    aliases=("torque-ripple",),
    separate_by="the torque of the sun's shaft: a ripple is in it, a runout is not",
    reference="approach of an eccentric gear, e sin(angle against the line of action)",
)
def sun_runout(sun_wave, pressure_angle, *, cosine=COSINE, sine=SINE):
    """An eccentric sun presses one planet after the other, once a turn of the sun against the carrier.

    To a sensor on the ring that is the order of the sun's shaft: for the article's gear 66h +- 3.75 and 66h +- 0.75,
    as for a torque ripple, but in another ratio. 66h +- 2.75 appears where the planets are not alike.
    """
    turned = (cosine - 1j * sine) * np.exp(1j * pressure_angle)
    return turned.real * sun_wave.real - turned.imag * sun_wave.imag


@effect(
    "planet-runout",
    adds_to=("sun_error", "ring_error"),
    at="planet",
    neutral={"cosine": 0.0, "sine": 0.0},
    separate_by="the phase of its lines shows which planet",
    reference="approach of an eccentric gear, e sin(angle against the line of action), in both its meshes",
)
def planet_runout(carrier_turn, pressure_angle, planet_order, *, cosine=COSINE, sine=SINE):
    """An eccentric planet presses sun and ring in turn, once a turn of the planet against the carrier.

    The loads of all planets add up to the torque, so the lines are one carrier order beside those of the
    planet: for the article's
    gear 66h +- 3.1429 +- 1.
    """
    at = 2 * np.pi * planet_order * carrier_turn
    inner, outer = at - pressure_angle, at + np.pi + pressure_angle
    return {
        "sun_error": cosine * np.cos(inner) + sine * np.sin(inner),
        "ring_error": cosine * np.cos(outer) + sine * np.sin(outer),
    }


@effect(
    "carrier-runout",
    adds_to="ring_error",
    neutral={"cosine": 0.0, "sine": 0.0},
    aliases=("transmission-path", "ring-flexibility"),
    separate_by="turn the ring in its housing by an angle: the phase goes with it",
    reference="eccentric gears: e sin(angle) on the line of action; Gu and Velex, Mech. Mach. Theory 61 (2013)",
)
def carrier_runout(carrier_turn, planet_angle, pressure_angle, *, cosine=COSINE, sine=SINE):
    """The ring's teeth are eccentric to the axis of the carrier by a fixed vector: every planet is loaded once a turn.

    `cosine` is the part towards angle zero, `sine` that a quarter turn on. All planets meet the same ring, one after
    the other. When each has moved on to the place of the next, everything is as before. So planets that are alike add
    up at the orders of the ideal set alone, for the article's gear 66h and 66h +- 3k. These lines change, as another
    path to the sensor would change them, but with a phase that is locked to the ring.
    """
    at = 2 * np.pi * carrier_turn[None, :] + planet_angle[:, None] + pressure_angle
    return cosine * np.sin(at) - sine * np.cos(at)


def of_turn(multiple):
    """Cosine or sine part so many times a turn: a sum of independent errors of the pitch falls with the multiple."""
    size = 20.0 / multiple
    return Parameter(
        size / 5, "um", min=-size, max=size, lower=-200.0, upper=200.0, doc=f"part {multiple} times a turn"
    )


@effect(
    "pitch-errors",
    adds_to="sun_error",
    neutral={"alternate": 0.0} | {f"{part}_{k}": 0.0 for k in range(2, 7) for part in ("cosine", "sine")},
    aliases=("sun-runout", "tooth-crack", "planet-runout"),
    separate_by="the whole comb of the sun's turn: runout has its first line only, a crack grows with load",
    reference="ISO 1328-1:2013 (cumulative pitch deviation), as a Fourier series over the turn of the sun",
)
def pitch_errors(
    sun_wave,
    sun_teeth,
    *,
    cosine_2=of_turn(2),
    sine_2=of_turn(2),
    cosine_3=of_turn(3),
    sine_3=of_turn(3),
    cosine_4=of_turn(4),
    sine_4=of_turn(4),
    cosine_5=of_turn(5),
    sine_5=of_turn(5),
    cosine_6=of_turn(6),
    sine_6=of_turn(6),
    alternate=Parameter(
        1 / 3, "um", min=-5 / 3, max=5 / 3, lower=-200.0, upper=200.0, doc="of every second tooth"
    ),
):
    """The pitch of the sun's teeth varies: lines at multiples of the turn of the sun, from the second on.

    To a sensor on the ring, multiples of the sun's turn and whole passages of the planets beside the mesh: 66h +- 7.5,
    +- 4.5 and +- 8.25 of the article's gear. The first multiple belongs to runout. Of those beyond the sixth that of
    every second tooth is looked at, `alternate`: it lies at half a mesh. A crack has these lines too, but its pulse
    gives every multiple its phase and its size.
    """
    parts = (cosine_2 - 1j * sine_2, cosine_3 - 1j * sine_3, cosine_4 - 1j * sine_4, cosine_5 - 1j * sine_5,
             cosine_6 - 1j * sine_6)  # fmt: skip
    second_teeth = alternate * (sun_wave ** (sun_teeth // 2)).real if sun_teeth % 2 == 0 else 0.0
    return sum((part * sun_wave**k).real for k, part in enumerate(parts, 2)) + second_teeth


@effect(
    "tooth-crack",
    adds_to="sun_softness",
    separate_by="torque: the pulses grow with the load, those of a pitch error do not",
    reference="Chaari, Fakhfakh and Haddar, Eur. J. Mech. A 28 (2009) 461: a dip of the mesh stiffness while the tooth "
    "carries",
)
def tooth_crack(
    carrier_turn,
    planet_angle,
    sun_order,
    sun_teeth,
    mesh_geometry,
    *,
    softer=Parameter(
        0.1, "1", min=0.01, max=0.3, lower=-0.5, upper=0.9, doc="part of the stiffness that is missing"
    ),
    place=Parameter(
        0.0, "1", min=0.0, max=1.0, lower=-1.0, upper=2.0, doc="of the tooth, in turns of the sun"
    ),
):
    """A cracked tooth gives way more, with each planet once a turn of the sun: pulses 8.25 times a turn.

    Many lines of 2.75 orders; the pulses rise with the force, whether that is the load or a vibration.
    """
    turn = sun_order * carrier_turn[None, :] - planet_angle[:, None] / (2 * np.pi) - place
    part = (turn - np.floor(turn)) * (sun_teeth / mesh_geometry[0, 1])
    carries = part < 1.0
    dip = np.zeros(part.shape)
    dip[carries] = np.sin(np.pi * part[carries]) ** 2
    return softer * dip


@effect(
    "planet-position-error",
    adds_to="planet_position",
    at="planet",
    aliases=("unequal-load-sharing",),
    separate_by="two torques, or harmonics of the mesh beyond the first",
    reference="Parker and Lin, J. Mech. Des. 126 (2004) 365 (phase); Bodas and Kahraman, JSME Int. J. C 47 (2004) 908 "
    "(load sharing in inverse proportion to torque)",
)
def planet_position_error(
    *,
    error=Parameter(
        2.0, "um", min=-50.0, max=50.0, lower=-500.0, upper=500.0, doc="tangential, ahead positive"
    ),
):
    """A pin is ahead of its position: its planet carries less (the sun drives), and meets the ring earlier.

    Its effect on the load falls with 1/torque and is the same at every harmonic; its effect on the phase
    grows with the harmonic and does not depend on the torque.
    """
    return np.array([error])


@effect(
    "unequal-load-sharing",
    adds_to=("load_share", "planet_position"),
    at="planet",
    separate_by="several harmonics of the mesh and several torques: a position error also shifts the phase, with h",
    reference="Inalpolat and Kahraman, J. Sound Vib. 323 (2009) 677, section 2; IEC 61400-4 mesh load factor",
)
def unequal_load_sharing(
    mean_load,
    load_stiffness,
    pressure_cosine,
    *,
    share=Parameter(0.1, "1", min=-0.3, max=0.3, lower=-0.9, upper=2.0, doc="part by which it carries more"),
    pin=Parameter(
        0.5,
        "1",
        min=0.0,
        max=1.0,
        lower=0.0,
        upper=1.0,
        doc="part of it that is the pin's and not the teeth's",
    ),
):
    """One planet carries more, by the same fraction at every torque; the others carry less.

    Its teeth are stiffer, or its pin and bearing. These then give way less: the planet stands ahead as one that is out
    of place, but in proportion to the torque. At one torque both are the same.
    """
    ahead = -share * pin * mean_load / (load_stiffness * pressure_cosine)
    return {"load_share": share * (1.0 - pin), "planet_position": ahead}
