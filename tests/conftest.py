"""Property tests look at new cases where a person runs them, and at the same ones in CI.

scipy 1.17 took `sph_harm` away, and the library `acoustics`, beside which some results are set, still asks for it.
"""

import os

import scipy.special
from hypothesis import settings

if not hasattr(scipy.special, "sph_harm"):

    def sph_harm(m, n, azimuth, polar):
        return scipy.special.sph_harm_y(n, m, polar, azimuth)

    scipy.special.sph_harm = sph_harm

settings.register_profile("repeatable", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("repeatable")
