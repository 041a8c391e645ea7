"""Reference numbers of a rank-deficient grid identification, from numpy alone.

    grid_reference.py > nodes/grid_encoder/tests/it/numpy/radial_five_centres.txt

Radial deviations on five circles of radius 50 mm about (0, 0), (+-150, 0), (0, +-150), each with a free
centre, of a machine [w X' Y' b Z t] with the errors

    Cx = EXX + EXY - y EC0Y - y ECY,   Cy = EYY + EYX,   radial = (Cx cos + Cy sin) + centre

14 coefficients and 10 centres, of which 22 numbers are determined. Unknowns are in mm at the edge: shifts
over 200^k, turns over 200 * 200^k.
"""

from __future__ import annotations

import numpy as np

STATIONS = 72
RADIUS = 50.0
EDGE = 200.0
U = 1e-4
CENTRES = [(0.0, 0.0), (150.0, 0.0), (-150.0, 0.0), (0.0, 150.0), (0.0, -150.0)]


def rows() -> tuple[np.ndarray, np.ndarray]:
    design, right = [], []
    for circle, (cx, cy) in enumerate(CENTRES):
        for k in range(STATIONS):
            angle = 2.0 * np.pi * k / STATIONS
            c, s = np.cos(angle), np.sin(angle)
            x, y = cx + RADIUS * c, cy + RADIUS * s
            a, b = x / EDGE, y / EDGE
            row = [c * a, c * a**2, c * a**3, s * b, s * b**2, s * b**3]
            row += [c * b**2, c * b**3, s * a**2, s * a**3, -c * b]
            row += [-c * b * b, -c * b * b**2, -c * b * b**3]
            centres = np.zeros(2 * len(CENTRES))
            centres[2 * circle : 2 * circle + 2] = c, s
            i = circle * STATIONS + k
            du, dv = 1e-3 * np.sin(0.7 * i + 0.3), 1e-3 * np.cos(1.3 * i)
            design.append(np.concatenate([row, centres]))
            right.append(c * du + s * dv)
    return np.array(design) / U, np.array(right) / U


def main() -> None:
    design, right = rows()
    values = np.linalg.svd(design, compute_uv=False)
    inverse = np.linalg.pinv(design, rcond=1e-9)
    projector = inverse @ design
    residual = right - design @ (inverse @ right)
    rank = int(np.linalg.matrix_rank(design, tol=1e-9 * values[0]))
    print("# source: numpy", np.__version__, "svd and pinv of tests/peers/grid_reference.py")
    print("# five circles, radial, [w X' Y' b Z t], yaw of Y; units: mm at the edge, weights 1/0.1 um")
    print("rank", rank)
    print("chi_square", repr(float(residual @ residual)))
    for name, numbers in (
        ("singular", values[:rank]),
        ("beta", inverse @ right),
        ("cofactor", np.diag(inverse @ inverse.T)),
        ("seen", np.diag(projector)),
    ):
        print(name, *(repr(float(n)) for n in numbers))


if __name__ == "__main__":
    main()
