"""Effects at one place: openings in a wall, objects in the room."""

import numpy as np

from specan.models import Parameter, effect
from specan.room.model.field import Acting, WallPlace, opening
from specan.room.model.port import Port, point

# Patch over which an opening acts; a leak of 3 cm^2 has 1 cm, one of 50 cm^2 has 4 cm.
RADIUS = Parameter(
    0.02, "m", min=0.005, max=0.06, doc="of the patch over which it acts", fixed=True, spread=0.015
)
# End correction of a hole in a baffle over its radius: 8 / (3 pi) as a piston, 0.8217 as the air really moves (Norris &
# Sheng, J. Sound Vib. 135, 1989).
END = Parameter(
    8 / (3 * np.pi), "1", min=0.6, max=0.9, doc="end correction over radius", fixed=True, spread=0.027
)
# A box acts on the flow 12 % more than the ellipsoid of its proportions (volume and added mass of a cube 1.68 of its
# volume, of a square prism twice as long 1.36: DNV-RP-H103, 2011, table A-2; ball 1.5, ellipsoid 1.21: Lamb, 114),
# which 8 % of the coefficient here make of a ball; its radius of gyration is 4 % larger (an edge a^2 / 12, a half axis
# a^2 / 5, of the same volume).
FLOW = Parameter(
    1.0, "1", min=0.8, max=1.3, doc="air taken along that axis, over an ellipsoid's", fixed=True, spread=0.08
)
_SIZE = 0.04
# Pa s/m. Friction of an opening 2 to 4 cm wide at 150 Hz is 0.3, its radiation outside 1 to 9 from 150 to 450 Hz
# (Ingard, J. Acoust. Soc. Am. 25, 1953: sqrt(2 eta rho w) / 2 times 2 + 2 l / a; rho c (k a)^2 / 2).
_OF_RESISTANCE = 4.0
ACROSS = Parameter(0.3, "1", min=0.0, max=1.0, doc="place over the wall's first edge")
ALONG = Parameter(0.3, "1", min=0.0, max=1.0, doc="place over the wall's second edge")
PLACE = Parameter(0.35, "1", min=0.0, max=1.0, doc="place over the room's edge")
LENGTH = Parameter(1.0, "1", min=0.5, max=2.0, lower=0.2, upper=5.0, doc="along that axis, over volume^(1/3)")


@effect(
    "helmholtz-resonator",
    joins="local_loads",
    at="face",
    aliases=("panel-resonance", "leak"),
    separate_by="a microphone at the neck; closing it",
    reference="Kinsler et al., Fundamentals of Acoustics, ch. 10: f0 = (c / 2 pi) sqrt(S / (V l'))",
)
def helmholtz_resonator(
    frequency,
    density,
    *,
    neck_area=Parameter(1e-3, "m^2", min=5e-5, max=3e-2, lower=0.0, doc="of the neck"),
    resonance=Parameter(150.0, "Hz", min=20.0, max=800.0, doc="resonance frequency"),
    quality=Parameter(15.0, "1", min=3.0, max=60.0, doc="quality factor"),
    neck_length=Parameter(0.03, "m", min=0.005, max=0.1, doc="with end corrections", fixed=True, spread=0.02),
    radius=RADIUS,
    end=END,
    across=ACROSS,
    along=ALONG,
):
    """The air in a neck vibrates against the volume behind it and splits a mode near its own frequency.

    It acts at one place of the wall; the mode with a pressure maximum there changes most.
    """
    omega, omega0 = 2 * np.pi * frequency, 2 * np.pi * resonance
    impedance = density * neck_length * (omega0 / quality + 1j * (omega - omega0**2 / omega))
    return opening(WallPlace(across, along, radius), neck_area, impedance, 1j * omega * density, end)


@effect(
    "leak",
    joins="local_loads",
    at="face",
    aliases=("panel-resonance",),
    separate_by="sealing it; the lowest frequencies, where the response leaves the stiffness line",
    reference="Kinsler et al., Fundamentals of Acoustics, ch. 10 (open side branch): Z = r + j w rho l / S",
)
def leak(
    frequency,
    density,
    *,
    area=Parameter(1e-3, "m^2", min=1e-4, max=1e-2, lower=0.0, doc="open area"),
    length=Parameter(0.03, "m", min=0.003, max=0.2, doc="of the opening, end corrections included"),
    resistance=Parameter(
        5.0, "Pa*s/m", min=0.0, max=1000.0, doc="per unit area", fixed=True, spread=_OF_RESISTANCE
    ),
    radius=RADIUS,
    end=END,
    across=ACROSS,
    along=ALONG,
):
    """Air flows through an opening; its mass forms a low resonance with the stiffness of the room.

    Below that resonance the pressure falls off instead of following rho c^2 / (j w V).
    """
    mass_factor = 2j * np.pi * frequency * density
    return opening(
        WallPlace(across, along, radius), area, resistance + mass_factor * length, mass_factor, end
    )


@effect(
    "scatterer",
    joins="local_loads",
    separate_by="taking it out",
    reference="Morse & Ingard, Theoretical Acoustics, ch. 8: monopole and dipole; Lamb, Hydrodynamics, 114: ellipsoid",
)
def scatterer(
    frequency,
    density,
    sound_speed,
    room_origin,
    room_dimensions,
    *,
    volume=Parameter(1e-3, "m^3", min=1e-4, max=1e-2, lower=0.0, upper=2e-2, doc="of the object"),
    x=PLACE,
    y=PLACE,
    z=PLACE,
    length_x=LENGTH,
    length_y=LENGTH,
    flow_x=FLOW,
    flow_y=FLOW,
    flow_z=FLOW,
    size=Parameter(
        1.0, "1", min=0.9, max=1.2, doc="radius of gyration over an ellipsoid's", fixed=True, spread=_SIZE
    ),
):
    """A rigid object displaces air that would be compressed and moved: each mode shifts differently.

    A mode falls where the object is in a pressure node, and rises where it is in an antinode. Air flows around it as
    around an ellipsoid of its proportions: the coupling of the air that it takes away with itself makes 3/2 of the
    volume of a ball, more of what stands across the flow and less of what lies along it.
    """
    place = point(room_origin + np.array([x, y, z]) * room_dimensions)
    radius = size * float((3 * volume / (4 * np.pi)) ** (1 / 3)) or 1e-6
    proportions = (float(length_x), float(length_y), float(1 / (length_x * length_y)))
    omega = 2 * np.pi * frequency
    monopole = -1j * omega * volume / (density * sound_speed**2)
    dipoles = [-flow * volume / (1j * omega * density) for flow in (flow_x, flow_y, flow_z)]
    return tuple(
        Acting(Port(place, 0, radius, slope=slope, ball=True, proportions=proportions), load)
        for slope, load in zip((None, 0, 1, 2), (monopole, *dipoles), strict=True)
    )
