"""A worm gear that serves where no rig is at hand: the article's, tables 1 to 5."""

EXAMPLE_RIG = {
    "gear": {
        "z_worm": 4,
        "z_wheel": 30,
        "worm_pitch_diameter_mm": 35.0,
        "wheel_pitch_diameter_mm": 90.0,
        "lead_angle_deg": 18.92,
        "normal_pressure_angle_deg": 20.0,
        "worm_width_mm": 39.4,
        "wheel_width_mm": 25.0,
        "worm_bearing_positions_mm": [-40.7, 65.3],
        "wheel_bearing_positions_mm": [-33.0, 29.0],
    },
    "bearing": [
        {"designation": "6211", "shaft": "wheel", "count": 2},
        {"designation": "6009 2Z C3", "shaft": "worm"},
        {"designation": "6202", "shaft": "worm"},
    ],
    "oil": {
        "density_kg_m3": 1000.0,
        "viscosity_40C_mm2_s": 220.0,
        "viscosity_100C_mm2_s": 36.0,
        "volume_ml": 180.0,
    },
    "operation": {"oil_temperature_C": 58.0, "oil_level_percent": 100.0, "ambient_temperature_C": 22.0},
    "uncertainty": {"torque_setting_percent": 5.0, "model_discrepancy_percent": 0.5},
    "limits": {
        "speed_rpm": [1200.0, 2800.0],
        "output_torque_Nm": [0.0, 90.0],
        "oil_temperature_C": [25.0, 80.0],
    },
}
