"""Hits of a hammer on a tip with two modes an axis, as a recorder would write them: hits_x.csv, hits_y.csv."""

import numpy as np

RATE, SECONDS = 12_800, 0.32
MODES = {"x": [(780.0, 0.031, 1.9e7), (1880.0, 0.028, 1.4e7)], "y": [(742.0, 0.033, 1.7e7), (1790.0, 0.026, 1.6e7)]}  # Hz, ratio, N/m
chance = np.random.default_rng(1)

for axis, modes in MODES.items():
    samples = int(RATE * SECONDS)
    time = np.arange(samples) / RATE
    frequency = 2j * np.pi * np.fft.rfftfreq(samples, 1 / RATE)
    force, acceleration = [], []
    for size in (210.0, 265.0, 240.0):  # three hits, N
        pulse = size * np.sin(np.pi * np.clip((time - 0.05) / 4e-4, 0.0, 1.0))  # 0.4 ms
        spectrum = np.fft.rfft(pulse)
        receptance = sum(1 / k / (1 + 2 * z * s + s**2) for s, z, k in ((frequency / (2 * np.pi * f), z, k) for f, z, k in modes))
        force.append(pulse + 0.05 * chance.standard_normal(samples))
        acceleration.append(np.fft.irfft(spectrum * receptance * frequency**2, samples) + 0.3 * chance.standard_normal(samples))
    table = np.column_stack([np.arange(3 * samples) / RATE, np.concatenate(force), np.concatenate(acceleration)])
    np.savetxt(f"hits_{axis}.csv", table, fmt="%.7f,%.3f,%.3f", header="time (s),force (N),acceleration (m/s^2)", comments="")
