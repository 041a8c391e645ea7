"""What one circle says of sums of errors in either sense, where the lost motion is no step; with numpy alone.

    one_circle_two_senses.py

X and Y of a table lose 6 um at a reversal: the axis is behind by 3 um - 6 um exp(-angle since the reversal / 0.3 rad). No other
error. 360 stations on R = 50 mm about the origin, 0.1 um of noise. The 14 unknowns of the published separation, the
centre and a step of lost motion of each axis are fitted to the radial errors, stations beyond 4.5 sigma weighed down.
Both sums are zero on that machine.

Printed with numpy 2.4.6, um at the radius:

    cw   EYX3 - EC0Y -6.1357  EXY3 - EYX3 - ECY2 12.2903
    ccw  EYX3 - EC0Y  6.1765  EXY3 - EYX3 - ECY2 -12.3341
"""

import numpy as np

STATIONS, REVERSAL_RAD, LOST_UM, OUTLIER = 360, 0.3, 6.0, 4.5


def readings(sense, angle):
    """Errors along u and v at the stations, um, and which way each axis moved."""
    noise = 0.1 * (np.arange(STATIONS) * 7919 % STATIONS / 180 - 1)
    moves = np.array([-sense * np.sin(angle), sense * np.cos(angle)])
    since = np.arcsin(np.abs(moves))
    behind = LOST_UM / 2 * (1 - 2 * np.exp(-since / REVERSAL_RAD))
    return noise - behind * np.sign(moves), np.sign(moves)


def sums(sense):
    angle = np.radians(np.arange(STATIONS) + 0.5)
    c, s = np.cos(angle), np.sin(angle)
    (u, v), (way_x, way_y) = readings(sense, angle)
    columns = {f"EXX{n}": c * c**n for n in (1, 2, 3)}
    columns |= {f"EYY{n}": s * s**n for n in (1, 2, 3)}
    columns |= {f"EXY{n}": c * s**n for n in (2, 3)} | {f"EYX{n}": s * c**n for n in (2, 3)}
    columns |= {"EC0Y": -c * s} | {f"ECY{n}": -c * s * s**n for n in (1, 2, 3)}
    columns |= {"o_u": c, "o_v": s, "b_x": -way_x * c / 2, "b_y": -way_y * s / 2}
    design, radial = np.column_stack(list(columns.values())), c * u + s * v
    weight = np.ones(STATIONS)
    for _ in range(12):
        found = np.linalg.lstsq(design * weight[:, None], radial * weight, rcond=1e-6)[0]
        left = np.abs(radial - design @ found)
        weight = np.minimum(1, OUTLIER * 1.4826 * np.median(left) / np.maximum(left, 1e-12))
    of = dict(zip(columns, found))
    return of["EYX3"] - of["EC0Y"], of["EXY3"] - of["EYX3"] - of["ECY2"]


for name, sense in (("cw", -1), ("ccw", 1)):
    two, three = sums(sense)
    print(f"{name:4} EYX3 - EC0Y {two:7.4f}  EXY3 - EYX3 - ECY2 {three:7.4f}")
