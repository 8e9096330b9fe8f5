#!/usr/bin/env python3
"""Reads agent and adapter with a client of the standard library.

usage: read_server.py AGENT_PORT ADAPTER_PORT; prints `ready` when it listens to both, then, after the program `END` has begun, one JSON
object with what it has received."""
import json
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "clients"))
from mtconnect import Client, Shdr, assets  # noqa: E402

agent, adapter = (int(port) for port in sys.argv[1:3])
client, shdr = Client(agent), Shdr(adapter)
first = client.current()
assert all(o["value"] in ("UNAVAILABLE", ["Unavailable", "", ""]) for o in first.observations)
assert client.get("/probe", "HEAD") == b""
refused = [client.refused("/current", "POST"), client.refused("/current", "PUT"), client.refused("/sample?from=x"), client.refused("/nobody/current"),
           client.refused("/asset/x")]
shdr.ping()
streamed, ready = [], False
for document in client.stream(f"/sample?from={first.header['nextSequence']}&interval=0&count=50&heartbeat=200"):
    if not ready:
        print("ready", flush=True)
        ready = True
    streamed += document.observations
    if any(o["id"] == "program" and o["value"] == "END" for o in document.observations):
        break
while shdr.values.get("program") != "END":
    shdr.step()
sequences = [o["sequence"] for o in streamed]
print(json.dumps({
    "consecutive": sequences == list(range(first.header["nextSequence"], first.header["nextSequence"] + len(sequences))),
    "feed": [o["value"] for o in streamed if o["id"] == "feed"],
    "shdr_feed": shdr.history["feed"][1:],
    "alarms": client.current("?path=//DataItem[@id=%22alarms%22]").values()["alarms"],
    "shdr_alarms": shdr.values["alarms"],
    "teeth": client.current().values()["force_peak_tooth"],
    "shdr_teeth": shdr.values["force_peak_tooth"],
    "asset": assets(client.get("/asset/coefficients.a.b"))["coefficients.a.b"],
    "shdr_assets": list(shdr.assets),
    "pongs": shdr.pongs,
    "refused": refused,
    "items": len(client.devices.items)}))
