"""Evaluates made-up ISO 230 tests with numpy and scipy and writes data and results as JSON.

An implementation of the definitions that shares nothing with the crate: arrays instead of loops,
scipy.optimize for circles, spheres and extremes, scipy.stats for quantiles.
Run: python iso230_reference.py > iso230_reference.json   (numpy 2.4.6, scipy 1.17.1)
"""

import json

import numpy as np
from scipy import optimize, stats

rng = np.random.default_rng(2302)


def nanometres(values):
    """What a device would print: mm in steps of 1 nm."""
    return np.round(values, 6)


def positioning():
    targets = np.array([7.3, 121.9, 238.4, 361.2, 477.7, 603.1, 719.6, 842.8, 961.5])
    lead = 12e-6 * targets + 0.0021 * np.sin(targets / 90.0)
    up = nanometres(lead + rng.normal(0.0, 0.0011, (5, targets.size)))
    down = nanometres(lead - 0.0034 + 2e-6 * targets + rng.normal(0.0, 0.0008, (5, targets.size)))
    n = up.shape[0]
    mu, md = up.mean(axis=0), down.mean(axis=0)
    su, sd = up.std(axis=0, ddof=1), down.std(axis=0, ddof=1)
    reversal = mu - md
    r_i = np.max([2 * su + 2 * sd + abs(reversal), 4 * su, 4 * sd], axis=0)
    means = np.concatenate([mu, md])
    upper = np.concatenate([mu + 2 * su, md + 2 * sd])
    lower = np.concatenate([mu - 2 * su, md - 2 * sd])
    m = targets.size
    # 1 um/m of the device (k = 2) is the only length part; the zero is at the first target.
    u_length = 1e-6 * (targets - targets[0]) / 2
    variance = su**2 / n + u_length**2
    freedom = variance**2 * (n - 1) / (su**2 / n) ** 2
    return {
        "targets_mm": targets.tolist(),
        "up_mm": up.tolist(),
        "down_mm": down.tolist(),
        "means_up_mm": mu.tolist(),
        "means_down_mm": md.tolist(),
        "scatter_up_mm": su.tolist(),
        "scatter_down_mm": sd.tolist(),
        "reversals_mm": reversal.tolist(),
        "repeatabilities_mm": r_i.tolist(),
        "half_widths_up_mm": (stats.t.ppf(0.975, freedom) * np.sqrt(variance)).tolist(),
        "b": float(abs(reversal).max()),
        "b_mean": float(reversal.mean()),
        "r": float(r_i.max()),
        "r_up": float(4 * su.max()),
        "r_down": float(4 * sd.max()),
        "e": float(np.ptp(means)),
        "e_up": float(np.ptp(mu)),
        "e_down": float(np.ptp(md)),
        "m": float(np.ptp((mu + md) / 2)),
        "a": float(upper.max() - lower.min()),
        "a_up": float(upper[:m].max() - lower[:m].min()),
        "a_down": float(upper[m:].max() - lower[m:].min()),
    }


def periodic():
    period = 10.0
    positions = np.round(200.0 + 0.31 * np.arange(90), 2)
    phase = 2 * np.pi * positions / period
    true = 3e-5 * (positions - 200) + 0.0018 * np.cos(phase + 0.4) + 0.0006 * np.sin(2 * phase)
    deviations = nanometres(true + rng.normal(0.0, 0.0003, positions.size))
    x = np.column_stack(
        [np.ones_like(positions), positions - positions.mean()]
        + [f(h * phase) for h in (1, 2) for f in (np.cos, np.sin)]
    )
    beta, residual, _, _ = np.linalg.lstsq(x, deviations, rcond=None)
    freedom = positions.size - x.shape[1]
    covariance = residual[0] / freedom * np.linalg.inv(x.T @ x)

    def wave(turns):
        return np.array(
            [0, 0]
            + [f(2 * np.pi * h * turns) for h in (1, 2) for f in (np.cos, np.sin)]
        )

    def best(sign):
        start = min(np.linspace(0, 1, 200), key=lambda t: sign * wave(t) @ beta)
        found = optimize.minimize_scalar(
            lambda t: sign * wave(t) @ beta,
            bounds=(start - 0.01, start + 0.01),
            method="bounded",
            options={"xatol": 1e-12},
        )
        return wave(found.x)

    contrast = best(-1) - best(1)
    amplitudes, expanded, p_values = [], [], []
    for first in (2, 4):
        ab, cov = beta[first : first + 2], covariance[first : first + 2, first : first + 2]
        amplitude = np.hypot(*ab)
        amplitudes.append(float(amplitude))
        expanded.append(float(2 * np.sqrt(ab @ cov @ ab) / amplitude))
        p_values.append(float(stats.f.sf(ab @ np.linalg.inv(cov) @ ab / 2, 2, freedom)))
    return {
        "positions_mm": positions.tolist(),
        "deviations_mm": deviations.tolist(),
        "period_mm": period,
        "amplitudes_mm": amplitudes,
        "expanded_mm": expanded,
        "p_values": p_values,
        "slope": float(beta[1]),
        "residual_mm": float(np.sqrt(residual[0] / freedom)),
        "error_mm": float(contrast @ beta),
        "error_expanded_mm": float(2 * np.sqrt(contrast @ covariance @ contrast)),
    }


def circle(points, weights):
    def distances(c):
        return weights * (np.hypot(points[:, 0] - c[0], points[:, 1] - c[1]) - c[2])

    tolerance = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
    return optimize.least_squares(distances, [0.0, 0.0, 100.0], x_scale="jac", **tolerance).x


def circular():
    radius = 100.0
    paths = {}
    for sense, n in ((-1, 300), (1, 420)):
        angles = sense * 2 * np.pi * (np.arange(n) + 0.25) / n
        radial = (
            0.0031 * np.cos(2 * angles)
            + 0.0024 * np.sin(2 * angles)
            + sense * 0.0012 * np.sin(2 * angles)
            + 0.0017 * np.sign(np.sin(angles)) * np.cos(angles)
            + sense * 0.0009 * abs(np.sin(angles))
            + 0.0052
            + rng.normal(0.0, 0.0002, n)
        )
        points = np.column_stack([np.cos(angles), np.sin(angles)]) * (radius + radial)[:, None]
        paths[sense] = nanometres(points + [0.0121, -0.0083])
    both = np.concatenate([paths[-1], paths[1]])
    weights = np.concatenate([np.full(len(paths[s]), 1 / np.sqrt(len(paths[s]))) for s in (-1, 1)])
    c = circle(both, weights)
    polar = {}
    for sense, points in paths.items():
        arms = points - c[:2]
        angles = np.arctan2(arms[:, 1], arms[:, 0])
        order = np.argsort(angles)
        polar[sense] = (angles[order], np.hypot(*arms.T)[order])
    every = np.concatenate([polar[-1][0], polar[1][0]])
    apart = [np.interp(every, a, r, period=2 * np.pi) for a, r in polar.values()]
    result = {
        "radius_mm": radius,
        "clockwise_mm": paths[-1].tolist(),
        "counter_clockwise_mm": paths[1].tolist(),
        "centre_mm": c[:2].tolist(),
        "g_b": float(np.ptp(np.hypot(*(both - c[:2]).T))),
        "d": float(c[2] - radius),
        "h": float(abs(apart[0] - apart[1]).max()),
    }
    for sense, name in ((-1, "clockwise"), (1, "counter_clockwise")):
        points = paths[sense]
        own = circle(points, np.ones(len(points)))
        # F about the centre of both senses.
        radial = np.hypot(*(points - c[:2]).T) - radius
        result[name] = {
            "g": float(np.ptp(np.hypot(*(points - own[:2]).T))),
            "f_max": float(radial.max()),
            "f_min": float(radial.min()),
        }
    return result


def sphere():
    directions = [[0.0, 0.0, 1.0]]
    for polar, n, offset in ((22.5, 4, 0.0), (45, 8, 22.5), (67.5, 4, 45.0), (90, 8, 0.0)):
        for k in range(n):
            a = np.radians(360.0 * k / n + offset)
            s = np.sin(np.radians(polar))
            directions.append([s * np.cos(a), s * np.sin(a), np.cos(np.radians(polar))])
    directions = np.array(directions)
    azimuth = np.arctan2(directions[:, 1], directions[:, 0])
    side = np.hypot(directions[:, 0], directions[:, 1])
    radii = 15.0 + 0.0028 * side * np.cos(3 * azimuth + 0.3) + rng.normal(0, 0.0004, len(side))
    points = nanometres(directions * radii[:, None] + [312.4, -87.6, -204.1])

    def distances(c):
        return np.linalg.norm(points - c[:3], axis=1) - c[3]

    tolerance = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
    start = [312.0, -87.0, -204.0, 15.0]
    c = optimize.least_squares(distances, start, x_scale="jac", **tolerance).x
    return {
        "points_mm": points.tolist(),
        "centre_mm": c[:3].tolist(),
        "radius_mm": float(c[3]),
        "form_mm": float(np.ptp(distances(c))),
    }


def conformance():
    rows = []
    for value, u, lower, upper in (
        (9.6, 0.2, None, 10.0),
        (9.7, 0.2, None, 10.0),
        (10.35, 0.2, None, 10.0),
        (0.12, 0.05, 0.0, 0.2),
        (0.1, 0.06, 0.0, 0.2),
        (-0.3, 0.1, -0.1, None),
        (2.0, 0.5, 1.0, 3.0),
    ):
        over = 0.0 if upper is None else stats.norm.sf((upper - value) / u)
        under = 0.0 if lower is None else stats.norm.cdf((lower - value) / u)
        rows.append([value, u, lower, upper, float(1 - over - under)])
    return {"rows": rows, "factors": [[p, float(stats.norm.ppf(p))] for p in (0.9, 0.95, 0.99)]}


print(
    json.dumps(
        {
            "provenance": "iso230_reference.py, seed 2302, numpy 2.4.6, scipy 1.17.1; mm, rad",
            "positioning": positioning(),
            "periodic": periodic(),
            "circular": circular(),
            "sphere": sphere(),
            "conformance": conformance(),
        }
    )
)
