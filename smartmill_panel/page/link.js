// Client of the Foxglove WebSocket protocol: receives topics, sends none.
import { readerOf } from './ros1.js';

const PROTOCOL = 'foxglove.websocket.v1';
const MESSAGE = 1, TIME = 2;
const SILENCE = 1500;  // [ms] without a message; the server sends the time every 500
const RETRY = 700;     // [ms] until the next attempt

export class Link {
  constructor(address, namespace = '/smartmill') {
    this.address = address;
    this.namespace = namespace;
    this.listeners = new Map();  // topic -> functions
    this.last = new Map();       // topic -> {message, stamp}
    this.clock = null;           // server's time [s] and its arrival [ms]
    this.bytes = 0;
    this.lost = false;           // the server has dropped messages to this page
    this.connect();
  }

  full(topic) { return topic.startsWith('/') ? topic : `${this.namespace}/${topic}`; }

  // topic relative to the namespace; the listener receives (message, time of its arrival at the server [s]).
  on(topic, listener) {
    const name = this.full(topic);
    if (!this.listeners.has(name)) this.listeners.set(name, []);
    this.listeners.get(name).push(listener);
    this.subscribe();
  }

  // Whether the connection works.
  get alive() {
    return this.socket?.readyState === WebSocket.OPEN && this.clock !== null && performance.now() - this.clock.at < SILENCE;
  }

  // [s] current time of the server.
  now() { return this.clock ? this.clock.time + 1e-3 * (performance.now() - this.clock.at) : NaN; }

  // [s] since the last message of a topic; Infinity: none yet.
  age(topic) {
    const last = this.last.get(this.full(topic));
    return last && this.clock ? Math.max(0, this.now() - last.stamp) : Infinity;
  }
  message(topic) { return this.last.get(this.full(topic))?.message; }

  connect() {
    this.channels = new Map();       // topic -> channel
    this.subscriptions = new Map();  // id -> {topic, read}
    const socket = this.socket = new WebSocket(this.address, [PROTOCOL]);
    socket.binaryType = 'arraybuffer';
    socket.onmessage = event => {
      if (this.socket !== socket) return;
      if (typeof event.data === 'string') this.handleText(JSON.parse(event.data)); else this.handleData(event.data);
    };
    socket.onclose = () => {
      if (this.socket === socket) setTimeout(() => this.connect(), RETRY);
    };
    // A hanging server does not close the connection.
    const watch = setInterval(() => {
      if (socket.readyState === WebSocket.CLOSED || this.socket !== socket) clearInterval(watch);
      else if (this.clock && socket.readyState === WebSocket.OPEN && performance.now() - this.clock.at > 4 * SILENCE) socket.close();
    }, SILENCE);
  }

  handleText(text) {
    if (text.op === 'advertise') {
      for (const channel of text.channels) {
        this.channels.set(channel.topic, channel);
        this.onChannel?.(channel.topic);
      }
      this.subscribe();
    } else if (text.op === 'status' && text.level === 1) {
      this.lost = true;
    }
  }

  subscribe() {
    if (this.socket.readyState !== WebSocket.OPEN) return;
    const known = new Set([...this.subscriptions.values()].map(s => s.topic));
    const news = [];
    for (const topic of this.listeners.keys()) {
      const channel = this.channels.get(topic);
      if (!channel || known.has(topic)) continue;
      this.subscriptions.set(channel.id, { topic, read: readerOf(channel.schema, channel.schemaName) });
      news.push({ id: channel.id, channelId: channel.id });
    }
    if (news.length) this.socket.send(JSON.stringify({ op: 'subscribe', subscriptions: news }));
  }

  handleData(data) {
    this.bytes += data.byteLength;
    const view = new DataView(data), kind = view.getUint8(0);
    if (kind === TIME) {
      this.clock = { time: 1e-9 * Number(view.getBigUint64(1, true)), at: performance.now() };
      return;
    }
    const subscription = kind === MESSAGE ? this.subscriptions.get(view.getUint32(1, true)) : null;
    if (!subscription) return;
    const stamp = 1e-9 * Number(view.getBigUint64(5, true));
    const message = subscription.read(new DataView(data, 13));
    this.last.set(subscription.topic, { message, stamp });
    for (const listener of this.listeners.get(subscription.topic)) listener(message, stamp);
  }
}

// Topics of another machine over the same connection.
export class NamespaceLink {
  constructor(link, namespace) { Object.assign(this, { link, namespace }); }
  get alive() { return this.link.alive; }
  on(topic, listener) { this.link.on(`${this.namespace}/${topic}`, listener); }
  age(topic) { return this.link.age(`${this.namespace}/${topic}`); }
  message(topic) { return this.link.message(`${this.namespace}/${topic}`); }
}
