"""The planetary gear of the article, where no rig is at hand."""

EXAMPLE_RIG = {
    "gear": {"z_sun": 24, "z_planet": 21, "z_ring": 66, "planets": 3, "module_mm": 2.0},
    "operation": {"sun_speed_hz": 30.0, "carrier_torque_Nm": 60.0},
}
