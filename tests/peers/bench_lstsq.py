"""Time of the identification of 20,000 radial readings with 24 unknowns in numpy.

    bench_lstsq.py STATIONS PASSES

Five circles of radius 50 mm about (0, 0), (+-150, 0), (0, +-150), a free centre each, a machine
[w X' Y' b Z t] with the yaw of X. Rows are built by whole columns, then numpy.linalg.lstsq solves them and
the diagonal of the covariance is formed. Prints median times in ms and the coefficients, as JSON.
"""

from __future__ import annotations

import json
import statistics
import sys
import time

import numpy as np

RADIUS, EDGE, U = 50.0, 200.0, 1e-4
CENTRES = [(0.0, 0.0), (150.0, 0.0), (-150.0, 0.0), (0.0, 150.0), (0.0, -150.0)]


def readings(stations: int) -> tuple[np.ndarray, ...]:
    k = np.arange(stations)
    angle = np.tile(2.0 * np.pi * k / stations, len(CENTRES))
    circle = np.repeat(np.arange(len(CENTRES)), stations)
    centre = np.array(CENTRES)[circle]
    i = np.arange(len(angle))
    du, dv = 1e-3 * np.sin(0.7 * i + 0.3), 1e-3 * np.cos(1.3 * i)
    x = centre[:, 0] + RADIUS * np.cos(angle)
    y = centre[:, 1] + RADIUS * np.sin(angle)
    return circle, x, y, du, dv


def design(circle: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    centre = np.array(CENTRES)[circle]
    c, s = (x - centre[:, 0]) / RADIUS, (y - centre[:, 1]) / RADIUS
    a, b = x / EDGE, y / EDGE
    yaw = s * a - c * b
    columns = [c * a, c * a**2, c * a**3, s * b, s * b**2, s * b**3]
    columns += [c * b**2, c * b**3, s * a**2, s * a**3, -c * b]
    columns += [yaw * a, yaw * a**2, yaw * a**3]
    centres = np.zeros((len(x), 2 * len(CENTRES)))
    rows = np.arange(len(x))
    centres[rows, 2 * circle], centres[rows, 2 * circle + 1] = c, s
    return np.column_stack([*columns, centres]) / U, np.column_stack([c, s]) / U


def main(stations: int, passes: int) -> None:
    circle, x, y, du, dv = readings(stations)
    whole_ms, solve_ms = [], []
    for _ in range(passes):
        begin = time.perf_counter_ns()
        matrix, direction = design(circle, x, y)
        right = direction[:, 0] * du + direction[:, 1] * dv
        middle = time.perf_counter_ns()
        beta, _, rank, singular = np.linalg.lstsq(matrix, right, rcond=1e-9)
        residual = right - matrix @ beta
        variance = residual @ residual / (len(right) - rank)
        inverse = np.linalg.pinv(np.linalg.qr(matrix, mode="r"), rcond=1e-9)
        uncertainty = np.sqrt(variance * np.sum(inverse**2, axis=1))
        end = time.perf_counter_ns()
        whole_ms.append((end - begin) / 1e6)
        solve_ms.append((end - middle) / 1e6)
    print(
        json.dumps(
            {
                "whole_ms": statistics.median(whole_ms),
                "solve_ms": statistics.median(solve_ms),
                "rank": int(rank),
                "beta": beta[:14].tolist(),
                "uncertainty": uncertainty[:14].tolist(),
            }
        )
    )


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(int(sys.argv[1]), int(sys.argv[2]))
