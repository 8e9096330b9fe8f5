#!/usr/bin/env python3
"""An independent client of the panel: WebSocket frames of python3-websockets, protocol from its specification.
usage: independent_client.py PORT TOPIC COUNT; prints one JSON object with the received data."""
import asyncio
import json
import struct
import sys

import websockets


async def main(port, topic, count):
    received = {"payloads": [], "clock": 0}
    async with websockets.connect(f"ws://127.0.0.1:{port}/", subprotocols=["foxglove.websocket.v1"], max_size=None) as ws:
        received["subprotocol"] = ws.subprotocol
        received["info"] = json.loads(await ws.recv())
        advertised = json.loads(await ws.recv())
        received["op"] = advertised["op"]
        channel = next(c for c in advertised["channels"] if c["topic"] == topic)
        received["channel"] = channel
        await ws.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 4242, "channelId": channel["id"]}]}))
        while len(received["payloads"]) < count:
            frame = await ws.recv()
            if isinstance(frame, str):
                continue
            if frame[0] == 2:
                received["clock"] = struct.unpack("<Q", frame[1:9])[0]
                continue
            kind, subscription, stamp = struct.unpack("<BIQ", frame[:13])
            assert kind == 1 and subscription == 4242, frame[:13]
            received["payloads"].append([stamp, frame[13:].hex()])
        await ws.send(json.dumps({"op": "advertise", "channels": [{"id": 1, "topic": "/evil", "encoding": "ros1"}]}))
        while True:
            frame = await ws.recv()
            if isinstance(frame, str) and json.loads(frame)["op"] == "status":
                received["status"] = json.loads(frame)
                break
    print(json.dumps(received))


asyncio.run(asyncio.wait_for(main(int(sys.argv[1]), sys.argv[2], int(sys.argv[3])), 30))
