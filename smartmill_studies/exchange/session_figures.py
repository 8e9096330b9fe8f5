#!/usr/bin/env python3
"""Reads a running session with an MTConnect client (urllib, xml.etree), or with another client's program, and compares every value with the
topics, to the printed digits.

usage: session_figures.py AGENT_PORT SECONDS [COMMAND...]    with the ROS master of the session, exchange_node with sample_period 0 next to it
  COMMAND  a client that prints lines [item, value, status, time in microseconds, wall time of its arrival in s]:
           node smartmill_exchange/test/clients/mqtt.js PORT PREFIX SECONDS
           node smartmill_exchange/test/clients/opcua.js PORT --follow SECONDS

Prints: observations and their sequence numbers, values compared and different, latency from a message of cnc/state to the item in the client."""
import calendar
import collections
import json
import math
import pathlib
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "smartmill_exchange/test/clients"))
import rospy  # noqa: E402
from mtconnect import Client, assets  # noqa: E402
from smartmill_msgs import msg  # noqa: E402

port, seconds = int(sys.argv[1]), float(sys.argv[2])
RPM = 60 / (2 * math.pi)
# Values of the messages under the microseconds of their stamp; two messages may have the same.
expected = collections.defaultdict(lambda: collections.defaultdict(set))
received = {}  # stamp of cnc/state: wall time of its reception here


def key(stamp):
    return (stamp.to_nsec() + 500) // 1000


def keep(stamp, **values):
    for name, value in values.items():
        if math.isfinite(value):
            expected[key(stamp)][name].add(f"{value:.9g}")


def state(m):
    received[key(m.header.stamp)] = time.time()
    if m.connected:
        axes = {a.lower(): 1e3 * p for a, p in zip(m.axes, m.position)}
        keep(m.header.stamp, feed=1e3 * m.feed, spindle_speed=m.spindle_speed * RPM, **{f"{a}_position": p for a, p in axes.items() if a in "xyz"})


def load(m):
    keep(m.header.stamp, spindle_load=100 * m.spindle_load, **{f"{a.lower()}_load": 100 * v for a, v in zip(m.axes, m.axis_load) if a.lower() in "xyz"})


def chatter(m):
    if m.valid:
        keep(m.header.stamp, chatter_frequency=m.frequency, chatter_energy=100 * m.energy_ratio, chatter_force=m.severity)


rospy.init_node("session_figures", anonymous=True, disable_signals=True)
coefficients = {}
rospy.Subscriber("/smartmill/cnc/state", msg.CncState, state, queue_size=10000)
rospy.Subscriber("/smartmill/cnc/load", msg.LoadSample, load, queue_size=10000)
rospy.Subscriber("/smartmill/chatter/state", msg.ChatterState, chatter, queue_size=10000)
rospy.Subscriber("/smartmill/material/coefficients", msg.CuttingCoefficients, lambda m: coefficients.__setitem__(f"{m.tool}.{m.material}", m), queue_size=100)
client = Client(port)
start, end = client.current().header["nextSequence"], time.time() + seconds
observations, lines = [], []


def read():
    for document in client.stream(f"/sample?from={start}&interval=0&count=1000&heartbeat=500"):
        now = time.time()
        observations.extend((o, now) for o in document.observations)
        if now > end:
            return


def microseconds(text):
    return calendar.timegm(time.strptime(text[:19], "%Y-%m-%dT%H:%M:%S")) * 1000000 + int(text[20:26])


if sys.argv[3:]:
    out = subprocess.run(sys.argv[3:], stdout=subprocess.PIPE, text=True, check=True).stdout
    for item, value, status, stamp, now in map(json.loads, out.splitlines()):
        text = f"{value:.9g}" if isinstance(value, (int, float)) else value
        lines.append((item, text if status == "Good" else "UNAVAILABLE", stamp, now))
else:
    read()
    lines = [(o["id"], o["value"], microseconds(o["time"]), now) for o, now in observations]
compared, different, latency = collections.Counter(), [], []
for item, value, stamp, now in lines:
    for near in (stamp, stamp - 1, stamp + 1):  # a stamp is a double with a resolution of 0.24 us
        if item in expected.get(near, {}) and value != "UNAVAILABLE":
            compared[item] += 1
            if value not in expected[near][item]:
                different.append((item, value, sorted(expected[near][item])))
            if near in received:
                latency.append(now - received[near])
            break
sequences = [o["sequence"] for o, _ in observations]
if observations:
    print(f"sequence numbers consecutive: {sequences == list(range(start, start + len(sequences)))}")
print(f"{len(lines)} observations")
print(f"{sum(compared.values())} values compared, {len(different)} different", different[:5], dict(compared))
peaks, margins = ([float(value) for item, value, *_ in lines if item == name and value != "UNAVAILABLE"] for name in ("force_peak", "stability_margin"))
print(f"force_peak: {len(peaks)} values, {min(peaks, default=math.nan):.1f} to {max(peaks, default=math.nan):.1f} N; "
      f"stability_margin: {len(margins)} values, {min(margins, default=math.nan):.1f} to {max(margins, default=math.nan):.1f} %")
found = assets(client.get("/assets"))
same = all(found["coefficients." + k]["quantities"]["ktc"][0] == float(f"{m.ktc:.9g}") for k, m in coefficients.items())
print(f"{len(found)} assets: {', '.join(found)}; coefficients equal those of the topic: {same}")
latency.sort()
if latency:
    print(f"latency after the reception of the message by rospy: median {1e3 * latency[len(latency) // 2]:.1f} ms, "
          f"99 % {1e3 * latency[len(latency) * 99 // 100]:.1f} ms")
