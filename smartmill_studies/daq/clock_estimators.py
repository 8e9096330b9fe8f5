#!/usr/bin/python3
"""Compares estimators of a converter's clock from the arrivals of its batches (docs/daq.md): deviation of the estimated time of the newest
sample from the true one, without its mean, between 60 s and 600 s. Seeds 0, 1 and 2; converters off by 30 and 100 ppm.

usage: clock_estimators.py"""
import numpy

RATE = 48000.0  # [Hz]
SETTLED = 60.0  # [s]


def arrivals(kind, seed, ppm, duration=600.0):
    """Nominal time, true time and arrival [s] of each batch. usb: batches of 241 samples, usb_frames: of 5 ms, a multiple of the frame."""
    random = numpy.random.default_rng(seed)
    batch = 0.005 if kind == "usb_frames" else (241 if kind == "usb" else 256) / RATE
    count = int(duration / batch)
    nominal = (numpy.arange(count) + 1) * batch
    true = nominal * (1.0 + 1e-6 * ppm)
    if kind == "tcp":
        delay = 0.3e-3 + random.exponential(0.2e-3, count) + (random.random(count) < 0.02) * random.random(count) * 10e-3
    else:
        frame = 1e-3
        delay = (numpy.ceil((true + 0.37e-3) / frame) * frame - true + 0.5e-3 + random.exponential(30e-6, count)
                 + (random.random(count) < 0.01) * random.random(count) * 5e-3)
    return nominal, true, numpy.maximum.accumulate(true + delay)


def lower_hull(x, y):
    hull = []
    for i in range(len(x)):
        while len(hull) > 1 and (y[hull[-1]] - y[hull[-2]]) * (x[i] - x[hull[-2]]) >= (y[i] - y[hull[-2]]) * (x[hull[-1]] - x[hull[-2]]):
            hull.pop()
        hull.append(i)
    return hull


def groups(x, width):
    edges = numpy.flatnonzero(numpy.diff(numpy.floor(x / width))) + 1
    return list(zip(numpy.r_[0, edges], numpy.r_[edges, len(x)]))


def by_hull(nominal, arrival, window):
    """Every 5 s: nominal time and delay of the line there."""
    delay = arrival - nominal
    parts = groups(nominal, 0.05)
    least = numpy.array([i + numpy.argmin(delay[i:j]) for i, j in parts])
    x, y = nominal[least], delay[least]
    result = []
    for k in range(200, len(parts), 100):
        now = nominal[parts[k][1] - 1]
        first = numpy.searchsorted(x, now - window)
        xs, ys = x[first:k + 1], y[first:k + 1]
        hull = lower_hull(xs, ys)
        edge = max([e for e in range(len(hull) - 1) if xs[hull[e]] <= xs.mean()], default=0)
        a, b = hull[edge], hull[edge + 1]
        result.append((now, ys[a] + (ys[b] - ys[a]) / (xs[b] - xs[a]) * (now - xs[a])))
    return numpy.array(result)


def by_kalman(nominal, arrival, least):
    """Offset and drift from the minimum (least) or the trimmed mean of each second; large innovations weigh less."""
    delay = arrival - nominal
    state, covariance, noise, last, number = None, None, 0.0, 0.0, 0
    result = []
    for i, j in groups(nominal, 1.0)[:-1]:
        slope = state[1] if state is not None else 0.0
        straight = delay[i:j] - slope * (nominal[i:j] - nominal[i])
        if least:
            k = i + numpy.argmin(straight)
            at, measured = nominal[k], delay[k]
        else:
            kept = straight < straight.min() + 4.0 * numpy.median(straight - straight.min())
            at, measured = nominal[i:j][kept].mean(), delay[i:j][kept].mean()
        if state is None:
            noise = numpy.median(straight - straight.min()) ** 2
            state, covariance, last = numpy.array([measured, 0.0]), numpy.diag([noise, 1e-8]), at
            continue
        step = at - last
        move = numpy.array([[1.0, step], [0.0, 1.0]])
        state, covariance, last = move @ state, move @ covariance @ move.T + numpy.diag([0.0, 1e-18 * step]), at
        innovation, variance, number = measured - state[0], covariance[0, 0] + noise, number + 1
        if number > 3:
            noise = max(noise + (min(innovation ** 2, 16.0 * variance) - variance) / min(number + 1, 20), 1e-14)
        variance = covariance[0, 0] + noise * max(1.0, abs(innovation) / (3.0 * numpy.sqrt(variance)))
        gain = covariance[:, 0] / variance
        state, covariance = state + gain * innovation, covariance - numpy.outer(gain, covariance[0])
        result.append((nominal[j - 1], state[0] + state[1] * (nominal[j - 1] - last)))
    return numpy.array(result)


ESTIMATORS = [(f"lower hull, {w} s", lambda x, a, w=w: by_hull(x, a, w)) for w in (20, 60, 120, 300)]
ESTIMATORS += [("Kalman filter, minima of 1 s", lambda x, a: by_kalman(x, a, True)),
               ("Kalman filter, trimmed means of 1 s", lambda x, a: by_kalman(x, a, False))]
print("largest deviation [us], of three seeds and 30 and 100 ppm\n")
print(f"{'':38s}" + "".join(f"{kind:>14s}" for kind in ("tcp", "usb", "usb_frames")))
for name, estimate in ESTIMATORS:
    row = []
    for kind in ("tcp", "usb", "usb_frames"):
        worst = 0.0
        for seed in (0, 1, 2):
            for ppm in (30.0, 100.0):
                nominal, true, arrival = arrivals(kind, seed, ppm)
                found = estimate(nominal, arrival)
                error = found[:, 1] - numpy.interp(found[:, 0], nominal, true - nominal)
                error = error[found[:, 0] > SETTLED]
                worst = max(worst, float(numpy.abs(error - error.mean()).max()))
        row.append(f"{1e6 * worst:14.2f}")
    print(f"{name:38s}" + "".join(row), flush=True)
