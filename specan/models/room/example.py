"""A room that serves where no rig is at hand."""

EXAMPLE_RIG = {
    "room": {"dims_m": [0.9, 0.6, 0.7]},
    "piston": {"wall": "x0", "centre_m": [0.0, 0.246, 0.3229], "radius_m": 0.05},
    "air": {"nominal_temperature_C": 20.0},
    "band": {"f_min_hz": 40.0, "f_max_hz": 600.0},
    "mics": {
        "position_m": [
            [0.1548, 0.0931, 0.1376],
            [0.1709, 0.228, 0.5666],
            [0.62, 0.41, 0.29],
            [0.8, 0.12, 0.6],
        ],
        "cards": [[1, 2], [3, 4]],
    },
}
