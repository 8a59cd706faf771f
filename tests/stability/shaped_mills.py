"""Mills with a shape, tips and limits: invented cuts whose limits two independent roads have found (`cutters.md` § 3).

Hill's determinant with Newton's method and a marched Floquet multiplier with Richardson's extrapolation agreed there to 1e-4, of the
serrated edge to 4e-3.
"""

import numpy as np

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Block, Engagement, Stepover
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.serration import Serration
from rcsa_ident.stability.tip_modes import TipModes

DEG, RPM = np.pi / 180.0, np.pi / 30.0
HALF_DOWN, SLOT = Engagement.from_immersion(0.5, "down"), Engagement(0.0, np.pi)
#: Direction, natural frequency [Hz], damping ratio, stiffness [N/m].
M1 = ((0, 910.0, 0.028, 1.6e7), (1, 980.0, 0.031, 1.4e7), (2, 1450.0, 0.040, 6e7))
M1_SOFT = (*M1[:2], (2, 620.0, 0.03, 1.5e7))
M2 = ((0, 310.0, 0.035, 3.2e7), (1, 335.0, 0.035, 2.8e7), (2, 410.0, 0.040, 5e7))
M2_SOFT = (*M2[:2], (2, 180.0, 0.03, 1.2e7))
M3 = ((0, 420.0, 0.03, 1.1e7), (1, 450.0, 0.03, 1e7), (2, 900.0, 0.03, 3e7))
M3_SOFT = (*M3[:2], (2, 380.0, 0.03, 1.5e7))
G = ((0, 563.6, 0.0558, 1.4986 * (2 * np.pi * 563.6) ** 2), (1, 516.21, 0.025004, 1.199 * (2 * np.pi * 516.21) ** 2))


def tip(modes, slope=None):
    """Return the modes of a tip; with a slope, x'/x and y'/y [1/m]."""
    count = 5 if slope is not None else 3 if len(modes) > 2 else 2
    pole, outputs, inputs = [], [], []
    for direction, frequency, zeta, stiffness in modes:
        omega = 2.0 * np.pi * frequency
        damped = omega * np.sqrt(1.0 - zeta**2)
        shape = np.eye(count)[direction]
        if slope is not None and direction < 2:
            shape[3 + direction] = slope
        pole.append(-zeta * omega + 1j * damped)
        outputs.append(shape)
        inputs.append(shape / (2j * damped * stiffness / omega**2))
    return TipModes(np.array(pole), np.array(outputs, dtype=complex).T, np.array(inputs), np.zeros((count, count)))


def cut(cutter, engagement, tangential, radial_ratio, axial_ratio=0.0, feed=None):
    """Return a cut with exactly known coefficients."""
    known = CuttingCoefficients(tangential, radial_ratio, axial_ratio, tangential_spread=0.0, ratio_spread=0.0)
    return MillingProcess(cutter, known, engagement, feed_per_tooth=feed)


def face(teeth, diameter, y_from, y_to, corner=0.0):
    """Return a face mill with a lead angle of 45 degrees over a plate."""
    outline = Profile.face(diameter, 45 * DEG, 0.03, corner)
    return cut(Cutter(teeth, diameter, profile=outline), Block(y_from, y_to), 2000e6, 0.4, 0.25)


def end_mill(helix, pitch=None):
    """Return a half immersion down cut of Ø16 mm with four teeth."""
    return cut(Cutter(4, 0.016, helix=np.radians(helix), pitch=None if pitch is None else np.radians(pitch)), HALF_DOWN, 800e6, 0.35)


def variable_pitch(pitch, helix):
    """Return the cut of the literature's usual cutter of variable pitch, Ø19.05 mm."""
    return cut(Cutter(4, 0.01905, helix=np.radians(helix), pitch=np.radians(pitch)), HALF_DOWN, 697e6, 255.8 / 697.0)


def rougher(feed):
    """Return a half immersion down cut of a serrated edge."""
    wavy = Cutter(3, 0.016, helix=30 * DEG, serration=Serration(0.25e-3, 1.5e-3))
    return cut(wavy, HALF_DOWN, 1600e6, 0.36, 0.17, feed)


FACE = face(5, 0.063, -0.0189, 0.0252)
_HIGH_FEED = Cutter(3, 0.032, profile=Profile.face(0.032, 12 * DEG, 0.006))
HIGH_FEED = cut(_HIGH_FEED, Block(-0.016, 0.008), 2000e6, 0.4, 0.25)
HIGH_FEED_STEP = cut(_HIGH_FEED, Stepover(0.024, "down"), 2000e6, 0.4, 0.25)
_BALL = Cutter(2, 0.012, helix=30 * DEG, profile=Profile.ball(0.012))
BALL, BALL_DEEP = (cut(_BALL, SLOT, k, 0.36, 0.17) for k in (1800e6, 500e6))
BALL_BLOCK = cut(_BALL, Block(-0.006, -0.002), 1800e6, 0.36, 0.17)
BULL = cut(Cutter(4, 0.016, helix=35 * DEG, profile=Profile.bull_nose(0.016, 0.003)), Block(-0.008, -0.0016), 1600e6, 0.36, 0.17)
PITCH = [84.0, 96.0, 84.0, 96.0]
HELIX, HELIX_PITCH = end_mill([30.0, 36.0, 30.0, 36.0]), end_mill([38.0, 41.0, 38.0, 41.0], PITCH)

#: Cut, tip, speeds [rev/min], limits [mm].
LIMITS = {
    "A": (FACE, tip(M2), (700, 900, 1100, 1300), (1.1564, 1.4180, 1.1642, 2.3103)),
    "A, Z rigid": (FACE, tip(M2[:2]), (700, 900, 1100, 1300), (1.1266, 1.3734, 1.1331, 2.2755)),
    "A, Z soft": (FACE, tip(M2_SOFT), (700, 900, 1100, 1300), (1.1043, 1.3538, 1.1115, 2.2321)),
    "A, corner": (face(5, 0.063, -0.0189, 0.0252, 0.0012), tip(M2), (700, 900, 1100, 1300), (1.1893, 1.4516, 1.1977, 2.3384)),
    "A, slope -4": (FACE, tip(M2, -4.0), (700, 1100), (1.3580, 1.3663)),
    "A, slope -7": (FACE, tip(M2, -7.0), (700, 1100), (1.5629, 1.5716)),
    "A Ø100": (face(7, 0.1, -0.03, 0.04), tip(M2), (450, 700), (1.1097, 1.2358)),
    "A Ø100, slope -7": (face(7, 0.1, -0.03, 0.04), tip(M2, -7.0), (450, 700), (1.8380, 2.0719)),
    "A Ø160": (face(8, 0.16, -0.048, 0.064), tip(M2), (350, 520), (0.8046, 0.6907)),
    "A Ø160, slope -7": (face(8, 0.16, -0.048, 0.064), tip(M2, -7.0), (350, 520), (2.0820, 1.7658)),
    "B": (HIGH_FEED, tip(M3), (1800, 2400, 3200, 4200), (1.0188, 0.7294, 0.7370, 1.1843)),
    "B, Z rigid": (HIGH_FEED, tip(M3[:2]), (1800, 2400, 3200), (0.9878, 1.0221, 0.9959)),
    "B, Z soft": (HIGH_FEED, tip(M3_SOFT), (1800, 2400, 3200, 4200), (0.5524, 0.6966, 0.5929, 0.4275)),
    "B, stepover": (HIGH_FEED_STEP, tip(M3), (1800, 2400, 3200, 4200), (0.8096, 0.5995, 0.5953, 0.9313)),
    "B, stepover, Z rigid": (HIGH_FEED_STEP, tip(M3[:2]), (1800, 2400, 3200, 4200), (0.7542, 0.8049, 0.7799, 2.5760)),
    "C": (BALL, tip(M1), (8000, 10000, 13000, 17000), (0.8674, 0.9113, 1.7995, 0.6987)),
    "C, Z rigid": (BALL, tip(M1[:2]), (8000, 10000, 13000, 17000), (0.7880, 0.8649, 1.4247, 0.7578)),
    "C, Z soft": (BALL, tip(M1_SOFT), (8000, 10000, 13000, 17000), (0.6014, 0.7590, 1.3846, 0.7037)),
    "C, deep": (BALL_DEEP, tip(M1), (8000, 10000, 13000, 17000), (2.8959, 3.0882, 5.3529, 2.6340)),
    "C, block": (BALL_BLOCK, tip(M1), (8000, 10000, 17000), (4.2188, 5.6542, 4.5049)),
    "D": (BULL, tip(M1), (4000, 5500, 7000, 9000), (2.6939, 2.7044, 5.9665, 3.5850)),
    "D, Z rigid": (BULL, tip(M1[:2]), (4000, 5500, 7000, 9000), (2.6366, 2.6918, 5.8940, 3.5274)),
    "D, Z soft": (BULL, tip(M1_SOFT), (4000, 5500, 7000, 9000), (2.5025, 1.8465, 5.8961, 3.5858)),
    "E A": (HELIX, tip(M1[:2]), (3000, 4200, 5600, 7400), (4.1402, 5.5242, 5.1188, 6.0715)),
    "E B": (HELIX_PITCH, tip(M1[:2]), (3000, 4200, 5600, 7400), (3.6841, 5.2456, 7.1488, 12.1284)),
    "E B, pitch alone": (end_mill(39.5, PITCH), tip(M1[:2]), (3000, 4200, 5600, 7400), (3.4761, 4.9347, 6.3244, 9.1299)),
    "G": (variable_pitch([70, 110, 70, 110], 30.0), tip(G), (2000, 3000, 5000, 8000), (3.2434, 3.8899, 6.1582, 4.8429)),
    "G, helix, too": (variable_pitch([70, 110] * 2, [30.0, 35.0] * 2), tip(G), (2000, 3000, 5000, 8000), (3.0315, 4.0980, 6.4022, 4.2176)),
    "G, helix alone": (variable_pitch([90] * 4, [30.0, 35.0] * 2), tip(G), (2000, 3000, 5000, 8000), (2.8467, 1.4036, 1.4773, 11.089)),
}  # fmt: skip
#: The same of the serrated edge: feed [mm].
ROUGHER = {0.04: (6.22, 8.49, 7.11, 8.17), 0.08: (7.55, 8.32, 6.88, 8.77), 0.16: (8.68, 7.77, 6.34, 10.01)}
ROUGHER_SPEEDS = (3500, 5000, 6500, 8500)
#: Cut, tip, speed [rev/min], depth [mm], magnitude of the multiplier per period.
MULTIPLIERS = [
    (FACE, tip(M2), 900, 1.0, 0.76231), (FACE, tip(M2), 900, 2.0, 1.34669), (BALL, tip(M1), 10000, 0.5, 0.77974),
    (BALL, tip(M1), 10000, 2.0, 1.64081), (BALL_DEEP, tip(M1), 10000, 0.5, 0.64522), (BALL_DEEP, tip(M1), 10000, 2.0, 0.82567),
    (BULL, tip(M1), 5500, 1.5, 0.89548), (BULL, tip(M1), 5500, 4.0, 1.17920), (HELIX, tip(M1[:2]), 4200, 3.0, 0.18019),
    (HELIX, tip(M1[:2]), 4200, 8.0, 2.6546), (HELIX_PITCH, tip(M1[:2]), 5600, 3.0, 0.34100), (HELIX_PITCH, tip(M1[:2]), 5600, 9.0, 1.6754),
]  # fmt: skip


def deepest(process):
    """Return a depth that all limits of these cuts stand above [m]."""
    return min(process.cutter.outline.height, 0.0098 if process.cutter.profile is not None else 0.0147)
