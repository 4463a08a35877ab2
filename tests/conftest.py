"""Property tests look at new cases where a person runs them, and at the same ones in CI."""

import os

from hypothesis import settings

settings.register_profile("repeatable", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("repeatable")
