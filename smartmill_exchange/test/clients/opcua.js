// An OPC UA client (npm package node-opcua-client): reads all of Objects/Machines.
// usage: node opcua.js PORT [--user USER --password PASSWORD] [--follow SECONDS]
// Prints one JSON object {item: {value, status, time, units}}. With a user the connection is encrypted (Basic256Sha256). With --follow, every
// change of an item is printed as a line [item, value, status, time in microseconds since 1970, wall time of its arrival in s] instead.
"use strict";
const ua = require("node-opcua-client");

const options = { port: process.argv[2] };
for (let i = 3; i + 1 < process.argv.length; i += 2) options[process.argv[i].slice(2)] = process.argv[i + 1];

const plain = (value) => {
  if (value === null || value === undefined) return null;
  if (ArrayBuffer.isView(value)) return Array.from(value);
  return Array.isArray(value) ? value.map(plain) : value;
};
const microseconds = (data) => data.sourceTimestamp.getTime() * 1000 + Math.round((data.sourcePicoseconds || 0) / 1e6);

async function walk(session, nodeId, depth, found) {
  const browsed = await session.browse({ nodeId, referenceTypeId: "HierarchicalReferences", includeSubtypes: true, browseDirection: 0, resultMask: 63 });
  for (const reference of browsed.references) {
    const id = reference.nodeId;
    if (id.namespace === 0 && depth === 0) continue;
    if (reference.nodeClass === 2) found.set(String(id.value), id);
    await walk(session, id, depth + 1, found);
  }
}

async function main() {
  const secure = options.user !== undefined;
  const client = ua.OPCUAClient.create({
    endpointMustExist: false,
    connectionStrategy: { maxRetry: 1 },
    securityMode: secure ? ua.MessageSecurityMode.SignAndEncrypt : ua.MessageSecurityMode.None,
    securityPolicy: secure ? ua.SecurityPolicy.Basic256Sha256 : ua.SecurityPolicy.None,
  });
  await client.connect(`opc.tcp://127.0.0.1:${options.port}`);
  const session = await client.createSession(
    secure ? { type: ua.UserTokenType.UserName, userName: options.user, password: options.password } : undefined);
  const machines = await session.translateBrowsePath(ua.makeBrowsePath("RootFolder", "/Objects"));
  const nodes = new Map();
  await walk(session, machines.targets[0].targetId, 0, nodes);
  const items = [...nodes.keys()].filter((id) => !id.includes("/"));
  if (options.follow !== undefined) {
    const subscription = await session.createSubscription2({ requestedPublishingInterval: 50, requestedLifetimeCount: 1000,
      requestedMaxKeepAliveCount: 20, maxNotificationsPerPublish: 0, publishingEnabled: true, priority: 1 });
    for (const item of items) {
      const monitored = await subscription.monitor({ nodeId: nodes.get(item), attributeId: ua.AttributeIds.Value },
        { samplingInterval: 0, queueSize: 10000, discardOldest: true }, ua.TimestampsToReturn.Source);
      monitored.on("changed", (data) => console.log(JSON.stringify(
        [item, plain(data.value.value), data.statusCode.name, microseconds(data), Date.now() / 1000])));
    }
    console.error("following");
    await new Promise((resolve) => setTimeout(resolve, 1000 * Number(options.follow)));
    await subscription.terminate();
  } else {
    const found = {};
    for (const [id, nodeId] of nodes) {
      const data = await session.read({ nodeId, attributeId: ua.AttributeIds.Value });
      if (id.endsWith("/EngineeringUnits")) {
        const of = id.slice(0, -"/EngineeringUnits".length);
        found[of] = Object.assign(found[of] || {}, { units: data.value.value.displayName.text });
      } else {
        found[id] = Object.assign(found[id] || {}, { value: plain(data.value.value), status: data.statusCode.name,
          time: data.sourceTimestamp ? microseconds(data) : null });
      }
    }
    console.log(JSON.stringify(found));
  }
  await session.close();
  await client.disconnect();
}

main().then(() => process.exit(0), (error) => {
  console.error(`opcua.js: ${error.message}`);
  process.exit(1);
});
