"""Time per pose of the compensation in numpy: one call per pose, all axes of a pose at once.

    bench_compensation.py POSES PASSES < model.json

Prints the time per pose in ns (median of the fastest quarter of the passes, and of all) and the offsets of
the last pose in mm, as JSON: the thermal part by equation (1) of the drift model, each coordinate held at the
ends of its span; the geometric part as minus the error of the tip, from a product of 4 x 4 matrices from the
tool to the workpiece; the positioning part as minus the deviation of each slide, straight between points.
"""

from __future__ import annotations

import json
import statistics
import sys
import time

import numpy as np

DIRECTION = np.vstack([np.eye(3), np.eye(3)])


def turn(w: np.ndarray) -> np.ndarray:
    """Rotation by the vector w, to second order in its angle (microradians)."""
    cross = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    return np.eye(3) + cross + 0.5 * (cross @ cross)


def about(n: np.ndarray, angle: float) -> np.ndarray:
    """Rotation about the unit vector n."""
    cross = np.array([[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)


def pose(rotation: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """The 4 x 4 matrix of a rotation and a shift."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, shift
    return matrix


class Geometry:
    """A machine of three linear and two rotary axes with cubic error motions."""

    def __init__(self, given: dict) -> None:
        self.chain = given["chain"]
        self.coefficients = np.array(given["coefficients"])
        self.tool = np.append(np.array(given["tool_offset"]), 1.0)
        self.origin = np.array(given["origin"])
        self.joint = []
        for axis, carries_workpiece in self.chain:
            shift, tilt = np.array(given["location"][axis][:3]), np.array(given["location"][axis][3:])
            direction = turn(tilt) @ DIRECTION[axis]
            self.joint.append((axis, carries_workpiece, direction, self.origin[axis] + shift))

    def product(self, q: np.ndarray, six: np.ndarray | None) -> np.ndarray:
        """Tip in the workpiece frame; nominal without error motions."""
        whole = np.eye(4)
        for axis, carries_workpiece, direction, line in self.joint:
            origin = self.origin[axis] if axis > 2 else np.zeros(3)
            if six is None:
                direction, line, error = DIRECTION[axis], origin, np.eye(4)
            else:
                rotation = turn(six[axis, 3:])
                error = pose(rotation, origin - rotation @ origin + six[axis, :3])
            if axis < 3:
                joint = pose(np.eye(3), q[axis] * direction)
                whole = whole @ (error @ joint if carries_workpiece else joint @ error)
            else:
                rotation = about(direction, -q[axis] if carries_workpiece else q[axis])
                joint = pose(rotation, line - rotation @ line)
                whole = whole @ (joint @ error if carries_workpiece else error @ joint)
        return (whole @ self.tool)[:3]

    def offsets(self, q: np.ndarray) -> np.ndarray:
        """What to add to the linear axes: one Newton step, in machine directions."""
        powers = np.stack([q, q**2, q**3])
        six = np.einsum("apk,ka->ap", self.coefficients, powers)
        step = self.product(q, None) - self.product(q, six)
        for axis, carries_workpiece in self.chain:
            if carries_workpiece and axis > 2:
                step = about(DIRECTION[axis], q[axis]) @ step
        return step


def main(poses: int, passes: int) -> None:
    model = json.load(sys.stdin)
    p0, k0, slope, rate, slope_rate, tau, lower, upper = (
        np.array(model[key])
        for key in ("p0", "k0", "slope", "rate", "slope_rate", "tau", "lower", "upper")
    )
    cross, origin = np.array(model["cross"]), np.array(model["cross_origin"])
    q, elapsed_s = np.array(model["pose"]), model["elapsed_s"]
    # Constant through a model's life, and so made once: a matrix of own and cross slopes.
    cross_constant = np.sum(cross * origin, axis=1)
    geometry = Geometry(model["geometry"])
    points, deviation = np.array(model["points"]), np.array(model["deviation"])

    def offsets(q: np.ndarray, at_s: float) -> np.ndarray:
        held = np.minimum(np.maximum(q[:3], lower), upper)
        lever = held - p0
        grown = (rate + slope_rate * lever) * (-tau * np.expm1(-at_s / tau))
        thermal = k0 + slope * lever + cross @ held - cross_constant + grown
        own = np.array([np.interp(q[k], points, deviation[k]) for k in range(3)])
        return thermal + geometry.offsets(q) - own

    times_ns = []
    for _ in range(passes):
        begin = time.perf_counter_ns()
        for _ in range(poses):
            last = offsets(q, elapsed_s)
        times_ns.append((time.perf_counter_ns() - begin) / poses)
    fastest = sorted(times_ns)[: max(1, len(times_ns) // 4)]
    figures = {
        "nanos_per_pose": statistics.median(times_ns),
        "fastest_nanos_per_pose": statistics.median(fastest),
        "offsets_mm": last.tolist(),
    }
    print(json.dumps(figures))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(int(sys.argv[1]), int(sys.argv[2]))
