"""R7: the room is longer or shorter than drawn."""

from specan.models import Parameter, effect


@effect(
    "dimension-error",
    scales="room_dimensions",
    at="dimension",
    neutral={"error": 0.0},
    aliases=("temperature", "wall-impedance"),
    separate_by="a tape measure; a thermometer",
    reference="k_x = n pi / L_x",
)
def dimension_error(
    *, error=Parameter(0.003, "1", min=-0.01, max=0.01, lower=-0.03, upper=0.03, doc="of the edge")
):
    """One edge is not as drawn: only modes with a number along that edge move."""
    return 1 + error
