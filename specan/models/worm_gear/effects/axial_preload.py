"""Bearings that are pressed together by a spring or by their fit, always alike."""

from specan.models import Parameter, effect


@effect(
    "axial-preload",
    adds_to="bearing_axial_load",
    neutral={"force": 0.0},
    aliases=("mesh-starvation", "thermal-lag", "brake-drag"),
    separate_by="take the spring or the shims out and repeat a few conditions; runs without load against runs "
    "under load",
    reference="a constant axial force beside that of the mesh, in the SKF model for the frictional moment (catalogue "
    "10000 EN 2013); preloads of spring-loaded and adjusted deep groove bearings: up to some percent of C0",
)
def axial_preload(
    bearing_axial_load,
    *,
    force=Parameter(
        300.0, "N", min=50.0, max=2000.0, lower=0.0, upper=10000.0, doc="on each locating bearing"
    ),
):
    """A spring, a shim or a tight fit presses the bearings of a shaft together, with or without load.

    The balls then carry a load although the gear idles. Rolling and sliding moments grow
    as if the mesh pushed harder along the shaft: strongly at light load, less where the mesh already pushes.
    """
    return force * (bearing_axial_load >= 0)
