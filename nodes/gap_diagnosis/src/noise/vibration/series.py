#!/usr/bin/env python3
"""Writes series.csv: a vibration of 47.3 Hz in eight runs, read 250 times a second.

Its amplitude swings by 40 % with a period of 0.9 s, its phase is drawn for each run and walks; a slow wave and autoregressive
noise (0.6) are beside it. Rows are readings, columns runs, unit 0.01 um. First line: rms of the vibration alone, um.
"""

import numpy as np

RATE_HZ, RUNS, READINGS = 250.0, 8, 700
draw = np.random.default_rng(20261129)
time_s = np.arange(READINGS) / RATE_HZ
columns, squares = [], []
for run in range(RUNS):
    walk = np.cumsum(draw.normal(0.0, 0.02, READINGS))
    phase = draw.uniform(0.0, 2.0 * np.pi) + walk
    size = 0.3 * (1.0 + 0.4 * np.sin(2.0 * np.pi * time_s / 0.9 + draw.uniform(0.0, 6.28)))
    vibration = size * np.sin(2.0 * np.pi * 47.3 * time_s + phase)
    noise = np.zeros(READINGS)
    for k in range(1, READINGS):
        noise[k] = 0.6 * noise[k - 1] + draw.normal(0.0, 0.3)
    slow = 2.0 * np.sin(2.0 * np.pi * time_s / 5.0 + draw.uniform(0.0, 6.28))
    columns.append(vibration + noise + slow)
    squares.append(np.mean(vibration**2))
table = np.rint(100.0 * np.array(columns).T).astype(int)
with open("series.csv", "w", encoding="utf-8") as file:
    file.write(f"# numpy {np.__version__}, series.py; rms of the vibration {np.sqrt(np.mean(squares)):.6f} um\n")
    for row in table:
        file.write(",".join(map(str, row)) + "\n")
