"""A positioning test away from 20 degC and the same machine at 20 degC, with numpy.

No expansion is subtracted here: the warm scale drives the slide by its expanded graduations, the warm step gauge counts its
own expanded ones, and the figures are those of the scale's graduation errors at 20 degC.
Run: python iso230_20_degc.py > iso230_20_degc.json   (numpy 2)
"""

import json

import numpy as np

rng = np.random.default_rng(16015)
TARGETS = np.array([7.3, 121.9, 238.4, 361.2, 477.7, 603.1, 719.6, 842.8, 961.5])
SCALE = {"expansion_per_k": 8.1e-6, "temperature_degc": 23.4}
GAUGE = {"expansion_per_k": 11.5e-6, "temperature_degc": 21.2}


def factor(body):
    return 1.0 + body["expansion_per_k"] * (body["temperature_degc"] - 20.0)


def figures(up, down):
    means = np.concatenate([up.mean(axis=0), down.mean(axis=0)])
    spread = 2 * np.concatenate([up.std(axis=0, ddof=1), down.std(axis=0, ddof=1)])
    return {
        "e": float(np.ptp(means)),
        "a": float((means + spread).max() - (means - spread).min()),
        "m": float(np.ptp((up.mean(axis=0) + down.mean(axis=0)) / 2)),
    }


graduation = 0.0016 * np.sin(TARGETS / 150.0)
up_20 = graduation + rng.normal(0.0, 0.0004, (5, TARGETS.size))
down_20 = graduation - 0.0011 + rng.normal(0.0, 0.0004, (5, TARGETS.size))


def read(at_20):
    """Where the warm scale brings the slide, in warm graduations of the gauge, both from the first target."""
    true = (TARGETS - TARGETS[0] + at_20) * factor(SCALE)
    return true / factor(GAUGE) - (TARGETS - TARGETS[0])


print(
    json.dumps(
        {
            "targets_mm": TARGETS.tolist(),
            "up_mm": read(up_20).tolist(),
            "down_mm": read(down_20).tolist(),
            "scale": SCALE,
            "gauge": GAUGE,
            "as_read": figures(read(up_20), read(down_20)),
            "at_20_degc": figures(up_20, down_20),
        },
        indent=1,
    )
)
