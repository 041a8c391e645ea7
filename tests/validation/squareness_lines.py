"""Squareness between least-squares lines of trajectories that lie off the origin, from numpy alone.

    squareness_lines.py > nodes/grid_encoder/tests/numpy/squareness_lines.txt

A machine [w X' Y' b Z t] at Z = 0 without tool offset has, written out (docs: the head of nodes/grid_encoder/src/published.rs,
and the turn of X besides):

    Cx = EXX(x) + EXY(y) - EC0Y y - y (ECX(x) + ECY(y)),   Cy = EYY(y) + EYX(x) + x ECX(x)

Y is driven at x = 150 mm from -70 to 30 mm, X at y = -20 mm from 100 to 200 mm: the trajectories of a circle of 50 mm about
(150, -20). numpy.polyfit through 101 points of each gives its direction; the angle between the two less 90 degrees is EC0Y
between lines. The standard uncertainty is that of independent coefficients, by the change with each of them.
"""

from __future__ import annotations

import numpy as np

X = np.linspace(100.0, 200.0, 101)
Y = np.linspace(-70.0, 30.0, 101)
X0, Y0 = 150.0, -20.0
# (value, standard uncertainty) in mm/mm^k, rad/mm^k or rad.
ERRORS = {
    "EXX1": (2e-5, 1e-6),
    "EYY1": (-3e-5, 1e-6),
    "EXY2": (4e-7, 2e-8),
    "EXY3": (-1e-9, 1e-10),
    "EYX2": (-2e-7, 3e-8),
    "EYX3": (6e-10, 2e-10),
    "ECX1": (1e-7, 1e-8),
    "ECX2": (3e-10, 2e-11),
    "ECY1": (-2e-7, 2e-8),
    "EC0Y": (1.2e-4, 2e-6),
}


def powers(errors: dict[str, float], name: str, at: np.ndarray | float) -> np.ndarray | float:
    return sum(errors.get(f"{name}{k}", 0.0) * at**k for k in (1, 2, 3))


def between_lines(errors: dict[str, float]) -> float:
    turn = powers(errors, "ECX", X0) + powers(errors, "ECY", Y)
    across_y = powers(errors, "EXX", X0) + powers(errors, "EXY", Y) - errors["EC0Y"] * Y - Y * turn
    across_x = powers(errors, "EYY", Y0) + powers(errors, "EYX", X) + X * powers(errors, "ECX", X)
    along_y = np.array([np.polyfit(Y - Y.mean(), across_y, 1)[0], 1.0])
    along_x = np.array([1.0, np.polyfit(X - X.mean(), across_x, 1)[0]])
    cosine = along_x @ along_y / np.linalg.norm(along_x) / np.linalg.norm(along_y)
    return float(np.arccos(cosine) - np.pi / 2)


def main() -> None:
    errors = {name: value for name, (value, _) in ERRORS.items()}
    value = between_lines(errors)
    squares = 0.0
    for name, (_, u) in ERRORS.items():
        changed = between_lines(errors | {name: errors[name] + u})
        squares += (changed - value) ** 2
    print("# source: numpy", np.__version__, "polyfit, tests/validation/squareness_lines.py")
    print("tangent", repr(errors["EC0Y"]))
    print("lines", repr(value))
    print("standard_uncertainty", repr(float(np.sqrt(squares))))


if __name__ == "__main__":
    main()
