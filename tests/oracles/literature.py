"""Published figures, copied once, each with its source. SI unless a name says otherwise."""

from __future__ import annotations

import numpy as np

# Identified machine-spindle modes at the flange, [inprocess], tables A.4 (X) and A.5 (Y), as
# printed: natural frequency [Hz], damping ratio [%], Re and Im phi_t [sqrt(s/kg) 1e-4], Re and Im phi_r
# [rad sqrt(s/(kg m^2)) 1e-4]. With r = dw/dz and z from the tip towards the spindle phi_r changes its sign.
PUBLISHED_MODES = {
    "X": np.array(
        [
            [705.5, 20.0, 14.6, -14.2, 146.4, 141.5],
            [771.2, 18.9, 7.1, -3.6, 35.5, -17.8],
            [1026.9, 8.5, -7.4, 7.4, -73.8, -73.8],
            [1285.2, 7.8, -18.4, 18.4, -91.9, 91.9],
            [1287.5, 7.4, -16.1, 16.1, -160.8, -160.8],
            [1704.5, 5.0, -18.0, -14.6, -95.4, -77.2],
            [2354.6, 5.0, 18.3, -18.3, 91.8, 39.2],
            [2372.1, 5.0, -18.4, 18.4, -91.9, -34.1],
            [2419.0, 9.2, -14.8, -14.8, -147.6, -147.6],
            [2905.3, 7.9, -9.8, -9.8, -98.0, -55.3],
        ]
    ),
    "Y": np.array(
        [
            [600.0, 20.0, -15.3, 14.3, -153.3, -143.7],
            [894.8, 12.3, -8.7, 8.7, -87.5, -87.5],
            [1171.4, 13.3, 16.3, -16.3, 163.4, 9.6],
            [1682.6, 5.0, 6.6, -6.3, 65.6, 63.2],
            [1792.2, 5.0, 4.2, -4.2, 42.3, 42.0],
            [2191.8, 5.0, 14.0, 0.4, 69.9, 1.8],
            [2228.9, 12.2, -17.8, 17.8, -89.0, 89.0],
            [2347.7, 5.0, -17.9, 17.9, -89.3, 32.5],
            [2501.8, 5.4, -10.4, -10.4, -104.5, -45.9],
            [3000.0, 7.6, 10.8, 10.8, 107.6, -15.3],
        ]
    ),
}

# [inprocess], table A.6: N/m, N s/m, N m/rad, N m s/rad.
PUBLISHED_JOINT = {
    "translational_stiffness": 999.4e12,
    "translational_damping": 794.5,
    "rotational_stiffness": 999.8e12,
    "rotational_damping": 20.0,
}

# Nominal geometry for the toolings 1-4 of [inprocess], chosen from the published stickouts and holder types; not measured.
# Segments from the tip to the flange: length, outer diameter, inner diameter [mm], material.
NOMINAL_MATERIALS = {
    "carbide": {"youngs_modulus": 600e9, "density": 14400.0, "poisson": 0.22, "loss_factor": 0.003},
    "steel": {"youngs_modulus": 205e9, "density": 7850.0, "poisson": 0.3, "loss_factor": 0.003},
}
NOMINAL_TOOLINGS = {
    1: (
        (30.0, 9.6, 0.0, "carbide"),
        (40.5, 12.0, 0.0, "carbide"),
        (40.0, 50.0, 0.0, "steel"),
        (32.0, 50.0, 14.0, "steel"),
        (26.0, 63.0, 20.0, "steel"),
    ),
    2: (
        (30.0, 9.6, 0.0, "carbide"),
        (30.9, 12.0, 0.0, "carbide"),
        (50.0, 40.0, 0.0, "steel"),
        (24.0, 45.0, 14.0, "steel"),
        (26.0, 63.0, 20.0, "steel"),
    ),
    3: (
        (30.0, 9.6, 0.0, "carbide"),
        (35.9, 12.0, 0.0, "carbide"),
        (50.0, 40.0, 0.0, "steel"),
        (24.0, 45.0, 14.0, "steel"),
        (26.0, 63.0, 20.0, "steel"),
    ),
    4: (
        (30.0, 9.6, 0.0, "carbide"),
        (32.6, 12.0, 0.0, "carbide"),
        (40.0, 30.0, 0.0, "steel"),
        (30.0, 36.0, 14.0, "steel"),
        (26.0, 63.0, 20.0, "steel"),
    ),
}
PUBLISHED_STICKOUT_MM = {1: 70.5, 2: 60.9, 3: 65.9, 4: 62.6}

# Two-tooth mill of [insperger2004] with its zero-order limits; K_t, K_n in F = -w H (q - q_tau), that is
# K_tc = K_t and k_rc = K_n / K_t.
INSPERGER_STEPAN = {
    "teeth": 2,
    "tangential": 6.0e8,
    "normal": 2.0e8,
    "natural_frequency_hz": 922.0,
    "damping_ratio": 0.011,
    "modal_mass": 0.03993,
}
ZERO_ORDER_MINIMUM = {"slot": (0.04793e-3, 923.59), "half": (0.12674e-3, 924.12)}  # limit [m], chatter frequency [Hz]
ZERO_ORDER_SLOT_RPM = np.array([5000, 7500, 10000, 12500, 15000, 17500, 20000, 25000], dtype=float)
ZERO_ORDER_SLOT_LIMIT_MM = np.array([0.0480, 0.0564, 0.0734, 0.1385, 0.1169, 0.0483, 0.0625, 0.4853])

# Timoshenko beams with kappa = 6 (1 + nu)^2 / (7 + 12 nu + 4 nu^2) (`hutchinson`): roots of the frequency determinant
# in 30 digits [Hz]. Geometry in m, material in SI.
TIMOSHENKO = {
    "carbide_d12_L100": {
        "diameter": 0.012,
        "length": 0.1,
        "youngs_modulus": 580e9,
        "poisson": 0.22,
        "density": 14450.0,
        "clamped_free": np.array([1055.4969, 6335.0259, 16693.1830, 30344.9602, 46288.2438]),
    },
    "steel_d10_L125": {
        "diameter": 0.010,
        "length": 0.125,
        "youngs_modulus": 200e9,
        "poisson": 0.29,
        "density": 7800.0,
        "free_free": np.array([2838.0865, 7604.7563, 14352.7639, 22671.8761, 32208.5885]),
    },
}

# The same mill (one mode in x; "two": the same mode in y as well), and the mill of four modes after [gradisek2005], computed with
# Chebyshev spectral elements that are split where teeth enter and leave: two resolutions agree to 7e-9.
# Spectral radius at 5000 rev/min and 0.2, 0.5, 0.7, 1.0 mm.
MULTIPLIER_RPM, MULTIPLIER_DEPTH_MM = 5000.0, np.array([0.2, 0.5, 0.7, 1.0])
MULTIPLIERS = {
    ("one", 1.0, "down"): np.array([0.81974278, 1.07397559, 1.22155614, 1.40647353]),
    ("one", 0.5, "up"): np.array([0.91573718, 1.30585907, 1.51711354, 1.75804777]),
    ("one", 0.5, "down"): np.array([0.69372477, 0.81238294, 0.91815106, 1.08620819]),
    ("two", 1.0, "down"): np.array([2.13659148, 5.09774535, 7.42386502, 10.90390056]),
    ("two", 0.5, "up"): np.array([1.18540555, 2.01141608, 2.62527043, 3.62871024]),
    ("two", 0.5, "down"): np.array([1.18540555, 2.01141608, 2.62527043, 3.62871024]),
}
# First loss of stability of the slot over spindle speed.
LIMIT_RPM = np.array([5000, 7500, 10000, 12500, 15000, 17500, 20000, 25000], dtype=float)
SLOT_LIMIT_MM = {
    "one": np.array([0.40863, 0.32057, 0.32238, 2.70702, 0.38659, 0.50761, 1.41751, 3.93993]),
    "two": np.array([0.04751, 0.05480, 0.07141, 0.14835, 0.11445, 0.04805, 0.06322, 0.53013]),
}
# Half-immersion down-milling: frequency [Hz], damping ratio, mass [kg].
FOUR_MODES = {
    "teeth": 4,
    "tangential": 6.97e8,
    "normal": 2.558e8,
    "x": np.array([[441.64, 0.028722, 11.125], [563.6, 0.055801, 1.4986], [778.56, 0.058996, 13.063]]),
    "y": np.array([[516.2, 0.025004, 1.199]]),
    "rpm": np.array([2000.0, 5000.0, 7000.0, 10000.0]),
    "limit_mm": np.array([2.78505, 1.49104, 6.36278, 1.64411]),
}

# A milling robot's tool that the cut bends [du2023]: modes in x and y as frequency [Hz], damping ratio and
# mass-normalised shape [1/sqrt(kg)] at 3, 12, 24, 36 mm from the tip. The source leaves the diameter and the machine's compliance open;
# the limits below were computed for a diameter of 10 mm, solid carbide of 600 GPa and 0.26 um/N, modes that move the whole edge alike.
DEFORMED_TOOL = {
    "teeth": 3,
    "diameter": 0.010,
    "helix_degrees": 45.0,
    "length": 0.061,
    "youngs_modulus": 600e9,
    "machine_yy": 0.26e-6,
    "radial_depth": 0.004,
    "feed_rate": 0.6 / 60.0,
    "tangential": 855.00e6,
    "radial": 270.93e6,
    "tangential_edge": 15.64e3,
    "radial_edge": 14.167e3,
    "indentation": 1.5e14,
    "wear_land": 40e-6,
    "friction": 0.3,
    "heights": np.array([0.003, 0.012, 0.024, 0.036]),
    "x": (2060.49, 0.0237, np.array([3.232, 2.264, 1.738, 1.075])),
    "y": (2045.24, 0.0207, np.array([4.119, 3.347, 2.315, 1.755])),
}
# Limits [mm] without anything, with the deformation, with process damping, with both.
DEFORMED_LIMIT_MM = {
    3600.0: (1.28, 1.28, 2.54, 2.56),
    4100.0: (2.73, 2.74, 5.19, 5.25),
    7200.0: (1.26, 1.26, 1.67, 1.67),
    8000.0: (3.39, 3.42, 4.49, 4.53),
    8200.0: (5.02, 5.05, 6.26, 6.34),
    10000.0: (4.38, 4.41, 5.41, 5.46),
}
# The same with the measured shapes: constant below the first point, straight lines between the others.
DEFORMED_LIMIT_WITH_SHAPES_MM = {8200.0: (5.13, 5.18, 6.60, 6.70), 10000.0: (4.44, 4.47, 5.61, 5.68)}
# Deflection of the tip at the instant at which it generates the wall, over the depth, at 10 000 rev/min [mm].
TIP_DEFLECTION_MM = {1.0: 0.0084, 2.0: 0.0192, 3.0: 0.0323, 4.0: 0.0474, 5.0: 0.0641, 6.0: 0.0815, 6.85: 0.0944}
