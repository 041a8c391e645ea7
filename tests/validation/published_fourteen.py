"""Reference numbers of the published separation from any 14 of 360 stations, from numpy alone.

    published_fourteen.py > nodes/grid_encoder/tests/numpy/fourteen_of_360.txt

One circle of radius 50 mm about the origin of a machine [w X' Y' b Z t]. Readings less positions are 1 um sin(0.7 i + 0.3)
along X and 1 um cos(1.3 i) along Y at station i, with a scale of X of 100 um/m besides. The plate's zero and turn are
taken out of the readings and the first harmonic out of the radial deviations; then

    radial = (x Cx + y Cy)/R,   Cx = EXX + EXY - y EC0Y - y ECY,   Cy = EYY + EYX

is solved for the 14 coefficients (powers 1 to 3 of EXX, EYY, ECY; 2 and 3 of EXY, EYX; EC0Y), in mm at the radius, with the
Moore-Penrose inverse: of all stations, and of floor((k + s) 360/14), k = 0 to 13, s = 0 and 1/2.
"""

from __future__ import annotations

import numpy as np

STATIONS = 360
RADIUS = 50.0


def trace() -> tuple[np.ndarray, np.ndarray]:
    i = np.arange(STATIONS)
    angle = 2.0 * np.pi * i / STATIONS
    position = RADIUS * np.exp(1j * angle)
    reading = position + 1e-3 * (np.sin(0.7 * i + 0.3) + 1j * np.cos(1.3 * i)) + 1e-4 * position.real
    position = position - position.mean()
    reading = reading - reading.mean()
    turn = np.angle(np.sum(reading * position.conj()))
    off = reading * np.exp(-1j * turn) - position
    radial = off.real * np.cos(angle) + off.imag * np.sin(angle)
    first = np.column_stack([np.cos(angle), np.sin(angle)])
    radial = radial - first @ np.linalg.lstsq(first, radial, rcond=None)[0]
    return angle, radial


def design(angle: np.ndarray) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    columns = [c * c**k for k in (1, 2, 3)]
    columns += [s * s**k for k in (1, 2, 3)]
    columns += [c * s**k for k in (2, 3)]
    columns += [s * c**k for k in (2, 3)]
    columns += [-c * s]
    columns += [-c * s * s**k for k in (1, 2, 3)]
    return np.column_stack(columns)


def main() -> None:
    angle, radial = trace()
    print("# source: numpy", np.__version__, "pinv of tests/validation/published_fourteen.py")
    print("# 360 stations, R 50 mm, [w X' Y' b Z t]; unknowns in mm at the radius")
    whole = np.linalg.pinv(design(angle), rcond=1e-7) @ radial
    print("all", *map(repr, map(float, whole)))
    both = []
    for name, half in (("first", 0), ("second", 1)):
        idx = [(2 * k + half) * STATIONS // 28 for k in range(14)]
        both.append(np.linalg.pinv(design(angle[idx]), rcond=1e-7) @ radial[idx])
        print(name, *map(repr, map(float, both[-1])))
    print("apart", repr(float(np.abs(both[0] - both[1]).max())))
    print("traces_apart", repr(float(np.abs(design(angle) @ (both[0] - both[1])).max())))


if __name__ == "__main__":
    main()
