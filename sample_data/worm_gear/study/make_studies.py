"""Make the sample studies: a bench table with a hidden effect, and the study of the article's tables.

Run from anywhere::

    python sample_data/worm_gear/study/make_studies.py

The bench table comes from the simulated truth of `truth`, which shares no formula with the model.
"""

import shutil
import sys
from pathlib import Path

from specan.study.create import begin
from specan.study.edit import add_effect, drop_effect
from specan.study.study import Study

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))

from truth.worm_gear import simulate, write

HERE = Path(__file__).parent
GEAR = HERE.parent
HIDDEN = {"windage": 9.0}
STEPS = [
    ("add", "tooth-friction", "eq. 1 of the article"),
    ("add", "churning", "eq. 3"),
    ("add", "bearing-friction", "section 3.3"),
    ("add", "load-dependent-friction", "the loss torque rises and falls again with the load"),
    ("drop", "bearing-friction", "superfluous"),
    ("add", "thermal-lag", "idle and loaded runs do not go together"),
]


def main() -> None:
    """Write everything anew."""
    write(simulate(11, HIDDEN, "grid"), HERE / "bench")
    article = HERE / "article"
    shutil.rmtree(article, ignore_errors=True)
    begin(
        article,
        "worm-gear",
        GEAR / "rig.toml",
        [GEAR / "table_7_idle.csv", GEAR / "table_8_loaded.csv"],
        validations=[GEAR / "table_9_validation.csv"],
        effects=[],
    )
    for action, effect, because in STEPS:
        change = add_effect if action == "add" else drop_effect
        change(Study(article), effect, because)


if __name__ == "__main__":
    main()
