"""Time per pose of the thermal offset in numpy: one call per pose, all axes of a pose at once.

    bench_compensation.py POSES PASSES < model.json

Prints the median time per pose in ns and the offsets of the last pose in mm, as JSON. The equation is
(1) of the drift model, each coordinate held at the ends of its span.
"""

from __future__ import annotations

import json
import statistics
import sys
import time

import numpy as np


def main(poses: int, passes: int) -> None:
    model = json.load(sys.stdin)
    p0, k0, slope, rate, slope_rate, tau, lower, upper = (
        np.array(model[key])
        for key in ("p0", "k0", "slope", "rate", "slope_rate", "tau", "lower", "upper")
    )
    cross, origin = np.array(model["cross"]), np.array(model["cross_origin"])
    pose, elapsed_s = np.array(model["pose"]), model["elapsed_s"]
    # Constant through a model's life, and so made once: a matrix of own and cross slopes.
    cross_constant = np.sum(cross * origin, axis=1)

    def offsets(p: np.ndarray, at_s: float) -> np.ndarray:
        held = np.minimum(np.maximum(p, lower), upper)
        lever = held - p0
        grown = (rate + slope_rate * lever) * (-tau * np.expm1(-at_s / tau))
        return k0 + slope * lever + cross @ held - cross_constant + grown

    times_ns = []
    for _ in range(passes):
        begin = time.perf_counter_ns()
        for _ in range(poses):
            last = offsets(pose, elapsed_s)
        times_ns.append((time.perf_counter_ns() - begin) / poses)
    print(json.dumps({"nanos_per_pose": statistics.median(times_ns), "offsets_mm": last.tolist()}))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(int(sys.argv[1]), int(sys.argv[2]))
