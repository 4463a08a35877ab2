"""Property tests look at new cases where a person runs them, and at the same ones in CI.

Tests of a model, and those that take it as their example, are left out where its folder is. Fits and diagnoses of a
state of a study are computed by the first test that asks for them.

scipy 1.17 took `sph_harm` away, and the library `acoustics`, beside which some results are set, still asks for it.
"""

import os
import re
from copy import copy
from pathlib import Path

import pytest
import scipy.special
from hypothesis import settings

if not hasattr(scipy.special, "sph_harm"):

    def sph_harm(m, n, azimuth, polar):
        return scipy.special.sph_harm_y(n, m, polar, azimuth)

    scipy.special.sph_harm = sph_harm

# No deadline: the first case of a test may load a library.
settings.register_profile("anew", deadline=None)
settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable" if os.environ.get("CI") else "anew")

WINGS = Path(__file__).parents[1] / "specan"
GONE = [wing for wing in ("fmu", "planetary_gear", "room", "worm_gear") if not (WINGS / wing).is_dir()]
USES = re.compile(
    "|".join(
        rf"specan[./]{w}\b|import {w}\b|sample_data/{w}\b|[\"' ]{w.replace('_', '[-_]')}[\"' ]" for w in GONE
    )
)


@pytest.fixture(scope="session", autouse=True)
def folder_of_a_user(request):
    """Settings, trust and machine code of the person who runs the tests are neither read nor changed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SPECAN_CONFIG_DIR", str(request.config.cache.mkdir("specan_config")))
        yield


@pytest.fixture(scope="module", autouse=True)
def computed_once(tmp_path_factory):
    """What the studies of all tests keep is found by each: it is named by a hash of all that it depends on."""
    from specan.study import history

    place = tmp_path_factory.getbasetemp()
    # Two processes share the directory above theirs.
    shared = (place.parent if "PYTEST_XDIST_WORKER" in os.environ else place) / "kept"
    find, keep = history.KeptResults.find, history.KeptResults.keep

    def everywhere(kept):
        kept = copy(kept)
        kept._folder = shared
        return kept

    def found(self, name, kind):
        result = find(self, name, kind)
        if result is None and (result := find(everywhere(self), name, kind)) is not None:
            keep(self, name, result)
        return result

    def kept(self, name, result):
        keep(everywhere(self), name, result)
        return keep(self, name, result)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(history, "MOST_FILES", 10_000)
        patch.setattr(history.KeptResults, "find", found)
        patch.setattr(history.KeptResults, "keep", kept)
        yield {"find": find, "keep": keep}


def pytest_ignore_collect(collection_path):
    """Whether a file of tests needs a model that is not there."""
    if GONE and collection_path.suffix == ".py":
        return True if USES.search(collection_path.read_text(encoding="utf-8")) else None
    return None


def pytest_collection_modifyitems(items):
    """Leave out the examples of modules that show a model which is not there."""
    for item in items if GONE else ():
        name = getattr(item, "callspec", None) and item.callspec.params.get("name")
        path = WINGS.parent / (str(name).replace(".", "/") + ".py")
        if path.is_file() and USES.search(path.read_text(encoding="utf-8")):
            item.add_marker(pytest.mark.skip(reason="shows a model that is not there"))
