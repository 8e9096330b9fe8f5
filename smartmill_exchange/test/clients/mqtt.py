#!/usr/bin/env python3
"""An MQTT client (python3-paho-mqtt) that collects retained messages.

usage: mqtt.py PORT PREFIX WAIT_TOPIC WAIT_TEXT [--user USER --password PASSWORD] [--ca FILE]
Prints one JSON object {topic without prefix: payload} once a message of WAIT_TOPIC (without prefix) contains WAIT_TEXT and all retained
messages have come; validates every observation against the schema of PREFIX/schema."""
import argparse
import json
import queue
import sys

import jsonschema
import paho.mqtt.client

parser = argparse.ArgumentParser()
parser.add_argument("port", type=int)
parser.add_argument("prefix")
parser.add_argument("topic")
parser.add_argument("text")
parser.add_argument("--user")
parser.add_argument("--password")
parser.add_argument("--ca")
options = parser.parse_args()

messages = queue.Queue()
client = paho.mqtt.client.Client()
client.on_connect = lambda c, *rest: c.subscribe(options.prefix + "/#", qos=1)
client.on_message = lambda c, data, message: messages.put(message)
subscribed = []
# The broker answers subscriptions in order: with the status of a second one, all messages of the first have come.
client.on_subscribe = lambda c, data, mid, qos: None if subscribed else subscribed.append(c.subscribe(options.prefix + "/status", qos=1))
if options.user:
    client.username_pw_set(options.user, options.password)
if options.ca:
    client.tls_set(options.ca)
client.connect("localhost" if options.ca else "127.0.0.1", options.port)
client.loop_start()
found = {}
statuses = 0
while options.text not in found.get(options.topic, "") or statuses < 2:
    message = messages.get(timeout=60)
    statuses += message.topic == options.prefix + "/status"
    found[message.topic.removeprefix(options.prefix + "/")] = message.payload.decode()
schema = json.loads(found["schema"])
jsonschema.Draft7Validator.check_schema(schema)
for topic, payload in found.items():
    if topic.startswith("items/"):
        jsonschema.validate(json.loads(payload), schema)
        assert json.loads(payload)["id"] == topic.removeprefix("items/")
client.loop_stop()
json.dump(found, sys.stdout)
