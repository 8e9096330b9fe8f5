// An MQTT client (npm package mqtt): prints every observation of PREFIX/items as a line
// [item, value, status (Good, Unavailable), time in microseconds since 1970, wall time of its arrival in s].
// usage: node mqtt.js PORT PREFIX [SECONDS]
"use strict";
const mqtt = require("mqtt");

const [port, prefix, seconds] = process.argv.slice(2);
const client = mqtt.connect(`mqtt://127.0.0.1:${port}`);
const microseconds = (time) => Date.parse(`${time.slice(0, 19)}Z`) * 1000 + Number(time.slice(20, 26));

client.on("connect", () => client.subscribe(`${prefix}/items/#`, { qos: 1 }, () => console.error("following")));
client.on("message", (topic, payload, packet) => {
  const { id, value, time } = JSON.parse(payload);
  if (packet.retain) return; // of the time before
  console.log(JSON.stringify([id, value, value === null ? "Unavailable" : "Good", microseconds(time), Date.now() / 1000]));
});
client.on("error", (error) => {
  console.error(`mqtt.js: ${error.message}`);
  process.exit(1);
});
if (seconds !== undefined) setTimeout(() => client.end(true, {}, () => process.exit(0)), 1000 * Number(seconds));
