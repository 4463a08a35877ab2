"""The table of steady runs from the CSV files of one run each, as the authors publish them.

    python make_table.py DIRECTORY > steady_runs.csv

DIRECTORY is `experiments/driveNo3` of https://github.com/RViMLab/TRO2021-Dynamic-Modelling. A run has some lines
about the controller, then time in ms, speed in rpm and torque in per cent of the motor's 9.84 mN m. Torques and
speeds of this table have the opposite sign: negative while the load is lifted. In three runs the first torque was
overwritten by a value far outside and the reading kept as a remark, `was -8.9`: the reading is taken.
"""

import re
import sys
from datetime import datetime
from pathlib import Path

import numpy as np

RATED = 9.84e-3  # N m
BLOCKS = 10  # of a run, whose means tell how well the mean of the run is known


def read(path):
    """When the run began, time, speed and torque."""
    rows, began = [], None
    for line in path.read_text(encoding="utf-8-sig").splitlines():
        if line.startswith("Date:"):
            began = datetime.fromisoformat(re.split("[;,]", line)[1])
        cells = [c for c in re.split("[;,]", line) if c]
        try:
            row = [float(c) for c in cells[:3]]
        except ValueError:
            continue
        remark = re.search(r"was (-?[\d.]+)", line)
        rows.append([*row[:2], float(remark[1]) if remark else row[2]])
    return began, *np.array(rows).T


def main(directory):
    """Print one row a run, in the order in which they were taken."""
    runs = sorted(((*read(path), path.stem) for path in directory.glob("*.csv")), key=lambda run: run[0])
    print("minutes,file,rpm,torque_Nm,sd,u_mean")
    for began, _, speed, torque, name in runs:
        torque = -RATED * torque / 100
        blocks = np.array([part.mean() for part in np.array_split(torque, BLOCKS)])
        minutes = (began - runs[0][0]).total_seconds() / 60
        print(
            f"{minutes:.1f},{name},{-speed.mean():.3f},{torque.mean():.6g},{torque.std(ddof=1):.3g},"
            f"{blocks.std(ddof=1) / np.sqrt(BLOCKS):.2g}"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
