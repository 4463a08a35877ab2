"""Flanks that run out of oil as they run faster."""

from specan.models import Parameter, effect

REFERENCE_VISCOSITY = 1e-4  # m^2/s
FILM = 0.67  # power of speed and viscosity in the thickness of a film (Hamrock and Dowson 1977)


@effect(
    "mesh-starvation",
    adds_to="friction_coefficient",
    neutral={"rise": 0.0},
    aliases=("axial-preload", "thermal-lag", "torque-zero-error"),
    separate_by="a higher oil level, or a jet of oil on the mesh, at high speed and torque",
    reference="film of a starved contact, h = h_full / (1 + (h_full/h_supplied)^g)^(1/g) (Chevalier, Lubrecht, Cann, "
    "Dalmaz 1998, J. Tribol. 120:126), h_full ~ (nu v)^0.67; the share of the film that lacks is carried by the flanks",
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
    sharpness=Parameter(3.0, "1", min=2.0, max=5.0, lower=1.0, upper=10.0, doc="g of the transition", fixed=True),
    level_exponent=Parameter(
        1.0, "1", min=0.0, max=3.0, lower=-1.0, upper=6.0, doc="power of the oil level in the oil supplied",
        needs=("oil_level",),
    ),
):  # fmt: skip
    """The worm throws off the oil that the next tooth needs.

    The film between the flanks cannot become thicker than the oil that comes back in time. Friction then
    rises with speed instead of falling: an extra loss at high speed, in proportion to the torque.
    """
    full = (
        sliding_speed / speed * kinematic_viscosity / REFERENCE_VISCOSITY
    ) ** FILM / oil_level**level_exponent
    share = (1.0 + full**sharpness) ** (-1.0 / sharpness)
    return rise * (1.0 - share)
