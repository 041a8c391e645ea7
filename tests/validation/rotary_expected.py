"""What a verification of rotary axes may leave, from numpy alone.

    rotary_expected.py > nodes/rotary_axes/tests/numpy/expected.txt

A machine [w C' A' Y' b X Z t], line of A through (0, 0, 50), of C through the origin, a sphere at (60, -40, 90) mm. It is read at 16
poses, eight location errors and the sphere's place are fitted by least squares, and the sphere is read again at six other
poses. What is left there, r = y_v - J_v pinv(J_c) y_c, has the covariance

    sigma^2 (1 + P P^T) + T C T^T,   P = J_v pinv(J_c),   T = [1, -P]

with C from these standard uncertainties, each taken through rigid motions by finite differences: ball 0.3 um in each direction, the
same at every reading; scales 1 um/m and squareness 1.5 urad of X, Y, Z; error motions of A and C 0.5 um and 2 urad over a turn, 0.63
of it in each coefficient of a (cos q - 1), b sin q and 0.32 of the second harmonic; any other error of the linear axes 0.5 um in each
direction, correlated as exp(-d^2/(2 150^2)). sigma = 0.5 um.
"""

from __future__ import annotations

import numpy as np

BALL = np.array([60.0, -40.0, 90.0])
ORIGIN_A = np.array([0.0, 0.0, 50.0])
SIGMA = 5e-4
CALIBRATION = [(a, c) for a in (-60, -30, 0, 25) for c in (0, 90, 180, -90)]
VERIFICATION = [(-45, 45), (-15, -135), (10, 135), (-50, -60), (-20, 20), (5, 100)]


def turn(vector) -> np.ndarray:
    """exp of a rotation vector."""
    x, y, z = vector
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=float)
    angle = np.linalg.norm(vector)
    if angle < 1e-300:
        return np.eye(3)
    return np.eye(3) + np.sin(angle) / angle * k + (1 - np.cos(angle)) / angle**2 * k @ k


def reading(a: float, c: float, place, location=np.zeros(8), of_a=np.zeros(6), of_c=np.zeros(6)) -> np.ndarray:
    """Where the sphere is; `of_a` and `of_c` are the error motions (shift, turn about the line's origin) at this pose."""
    ey0a, ez0a, eb0a, ec0a, ex0c, ey0c, ea0c, eb0c = location
    point_a = ORIGIN_A + [0.0, ey0a, ez0a]
    point_c = np.array([ex0c, ey0c, 0.0])
    axis_a = turn([0.0, eb0a, ec0a]) @ [1.0, 0.0, 0.0]
    axis_c = turn([ea0c, eb0c, 0.0]) @ [0.0, 0.0, 1.0]
    on_c = turn(axis_c * c) @ (place - point_c) + point_c
    on_c = turn(of_c[3:]) @ on_c + of_c[:3]
    on_a = turn(axis_a * a) @ (on_c - point_a) + point_a
    return turn(of_a[3:]) @ (on_a - ORIGIN_A) + ORIGIN_A + of_a[:3]


def stacked(poses, **more) -> np.ndarray:
    return np.concatenate([reading(np.radians(a), np.radians(c), **({"place": BALL} | more)) for a, c in poses])


def jacobian(poses) -> np.ndarray:
    columns = []
    for j in range(11):
        step = 1e-3 if j in (0, 1, 4, 5, 8, 9, 10) else 1e-5
        both = []
        for sign in (1.0, -1.0):
            location, place = np.zeros(8), BALL.copy()
            if j < 8:
                location[j] = sign * step
            else:
                place[j - 8] += sign * step
            both.append(stacked(poses, location=location, place=place))
        columns.append((both[0] - both[1]) / (2 * step))
    return np.column_stack(columns)


def motion_columns(poses) -> list[np.ndarray]:
    columns = []
    for axis in range(2):
        for component in range(6):
            size = 5e-4 if component < 3 else 2e-6
            for order, share in ((1, 0.63), (2, 0.32)):
                for kind in ("cos", "sin"):
                    column = []
                    for pose in poses:
                        a, c = np.radians(pose[0]), np.radians(pose[1])
                        q = (a, c)[axis]
                        value = np.cos(order * q) - 1 if kind == "cos" else np.sin(order * q)
                        step = 1e-3 if component < 3 else 1e-5
                        moved = np.zeros(6)
                        moved[component] = step
                        key = ("of_a", "of_c")[axis]
                        effect = (reading(a, c, BALL, **{key: moved}) - reading(a, c, BALL, **{key: -moved})) / (2 * step)
                        column.append(effect * value * size * share)
                    columns.append(np.concatenate(column))
    return columns


def common(poses) -> np.ndarray:
    points = stacked(poses).reshape(-1, 3)
    n = len(points)
    columns = [np.tile(np.eye(3)[k] * 3e-4, n) for k in range(3)]
    for k in range(3):
        columns.append(np.concatenate([np.eye(3)[k] * 1e-6 * p[k] for p in points]))
    for along, by in ((0, 1), (0, 2), (1, 2)):
        columns.append(np.concatenate([np.eye(3)[along] * 1.5e-6 * p[by] for p in points]))
    columns += motion_columns(poses)
    design = np.column_stack(columns)
    apart = np.linalg.norm(points[:, None, :] - points[None, :, :], axis=2)
    smooth = np.kron(2.5e-7 * np.exp(-0.5 * (apart / 150.0) ** 2), np.eye(3))
    return design @ design.T + smooth


def main() -> None:
    predict = jacobian(VERIFICATION) @ np.linalg.pinv(jacobian(CALIBRATION))
    n = predict.shape[0]
    noise = SIGMA**2 * (np.eye(n) + predict @ predict.T)
    left = np.hstack([np.eye(n), -predict])
    whole = noise + left @ common(VERIFICATION + CALIBRATION) @ left.T
    size = lambda covariance: np.sqrt(np.diag(covariance).reshape(-1, 3).sum(axis=1))
    print("# source: numpy", np.__version__, "of tests/validation/rotary_expected.py; mm")
    print("noise", *map(repr, map(float, size(noise))))
    print("whole", *map(repr, map(float, size(whole))))
    # Residuals of 1 um along X of the machine at every pose.
    r = np.tile([1e-3, 0.0, 0.0], n // 3)
    print("chi_square", repr(float(r @ np.linalg.solve(whole, r))))


if __name__ == "__main__":
    main()
