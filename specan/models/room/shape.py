"""What a room's shape decides of its model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from specan.models.quantity import Quantity


@dataclass(frozen=True)
class RoomShape:
    """A box, or a room from a mesh, as the model's builder needs it.

    Attributes
    ----------
    walls : tuple of str
        Elements of the axis ``wall``.
    quantities : tuple of Quantity
        ``room_origin``, ``room_dimensions``, ``room_modes``, and what the latter reads of the shape.
    axes : mapping
        Axes that only this shape has.
    lacks : mapping
        ``{axis: reason}``: effects that act along such an axis is not available.
    notes : tuple of str
        What is to be known before a study starts.
    """

    title: str
    walls: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    axes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    lacks: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
