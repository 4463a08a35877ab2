"""Effects of the source: its diaphragm, and what radiates beside it."""

import numpy as np

from specan.models import Parameter, effect
from specan.room.model.effects.openings_and_objects import ACROSS, ALONG
from specan.room.model.field import Acting, WallPlace


@effect(
    "piston-size",
    scales="piston_radius",
    aliases=("vibrometer-gain",),
    separate_by="a laser scan of the cone",
    reference="volume velocity pi a^2 v; directivity 2 J1(k a sin) / (k a sin)",
)
def piston_size(*, error=Parameter(0.05, "1", min=-0.2, max=0.2, lower=-0.5, upper=0.5, doc="of the radius")):
    """The effective radius is not the nominal one: level as its square, directivity above k a = 1."""
    return 1 + error


@effect(
    "piston-breakup",
    scales="piston_velocity_profile",
    aliases=("vibrometer-noise", "piston-size"),
    separate_by="scanning other points of the cone",
    reference="modal superposition: 1 + a / (1 - (f / fn)^2 + j eta f / fn)",
)
def piston_breakup(
    frequency,
    *,
    strength=Parameter(0.2, "1", min=-1.0, max=1.0, lower=-3.0, upper=3.0, doc="mean over point, static"),
    resonance=Parameter(1200.0, "Hz", min=300.0, max=8000.0, doc="of the cone"),
    loss_factor=Parameter(0.1, "1", min=0.02, max=0.5, doc="of the cone"),
):
    """The laser sees one point; near a resonance of the cone the mean velocity differs.

    The factor is common to all microphones.
    """
    ratio = frequency / resonance
    return 1 + strength * ratio**2 / (1 - ratio**2 + 1j * loss_factor * ratio)


@effect(
    "flanking-source",
    joins="sources",
    at="face",
    aliases=("piston-size", "leaning-wall"),
    separate_by="blocking the cone and measuring what is left",
    reference="superposition: + a G(x, x2) exp(-j w tau)",
)
def flanking_source(
    frequency,
    piston_radius,
    *,
    ratio=Parameter(
        0.1, "1", min=-0.5, max=0.5, lower=-2.0, upper=2.0, doc="volume velocity over the piston's"
    ),
    delay=Parameter(0.0, "s", min=0.0, max=2e-3, lower=0.0, doc="of the second path"),
    across=ACROSS,
    along=ALONG,
):
    """The cabinet, a port or the rear of the cone radiates too: an additional source at its own position."""
    strength = ratio * np.pi * piston_radius**2 * np.exp(-2j * np.pi * frequency * delay)
    return Acting(WallPlace(across, along, 0.02), strength)


@effect(
    "loudspeaker-ratio",
    scales="loudspeaker_ratio",
    at="loudspeaker",
    neutral={"level": 0.0, "delay": 0.0},
    separate_by="the vibrometer on one loudspeaker after the other, at the same drive",
    reference="superposition of the fields of all loudspeakers",
    instrument=True,
)
def loudspeaker_ratio(
    frequency,
    *,
    level=Parameter(0.5, "dB", min=-6.0, max=6.0, lower=-40.0, upper=40.0, doc="over the stated level"),
    delay=Parameter(1e-5, "s", min=-1e-3, max=1e-3, lower=-5e-3, upper=5e-3, doc="over the stated one"),
):
    """A further loudspeaker moves more or less, or later, than stated against the first where both are driven."""
    return 10 ** (level / 20) * np.exp(-2j * np.pi * frequency * delay)
