// Health of the graph: process of each node, and what it has received of each topic.
import { age, fixed, make, table } from '../format.js';

const STALE_AGE = 3;  // [s] of messages that are published once a second
const short = name => name.replace(/^\/?smartmill\//, '');
const count = value => make('span', { class: Number(value) > 0 ? 'word warn' : 'dim' }, String(value));

export class Health {
  constructor(nodes_card, inputs_card, link) {
    Object.assign(this, { link, found: new Map() });
    this.nodes = make('div', { class: 'dim scroll' }, 'No node yet');
    this.inputs = make('div', { class: 'dim scroll' }, 'No input yet');
    nodes_card.append(this.nodes);
    inputs_card.append(this.inputs);
    link.on('health', m => { this.found.set(m.node, { ...m, at: performance.now() }); });
  }
  refresh() {
    const nodes = [...this.found.values()].sort((a, b) => a.node.localeCompare(b.node));
    if (!nodes.length || performance.now() - (this.drawn ?? -Infinity) < 1000) return;
    this.drawn = performance.now();
    this.nodes.className = this.inputs.className = 'scroll';
    const state = m => {
      const silent = 1e-3 * (performance.now() - m.at);
      if (silent > STALE_AGE) return make('span', { class: 'word bad' }, `silent for ${age(silent)}`);
      return m.starts > 1 ? make('span', { class: 'word warn' }, `restarted ${m.starts - 1} times`) : make('span', { class: 'word good' }, 'runs');
    };
    this.nodes.replaceChildren(table(['Node', '', 'for', 'Processor [%]', 'Memory [MB]', 'Files', 'Threads'], nodes.map(m => [
      short(m.node), state(m), age(Date.now() / 1000 - m.started), fixed(100 * m.cpu, 0), fixed(1e-6 * m.memory, 0), m.descriptors, m.threads]), { id: 'health-nodes' }));
    const rows = nodes.flatMap(m => m.inputs.map(i => [
      short(m.node), short(i.topic), i.publishers ? '' : make('span', { class: 'dim' }, 'no publisher'), String(i.received), count(i.lost), String(i.waiting), count(i.dropped), count(i.refused),
      count(i.lost_samples), i.received > 0 ? age(i.silent) : '–', i.latency > 0 ? fixed(1e3 * i.latency, 0) : '–', i.fault ? make('span', { class: 'word bad' }, i.fault) : '']));
    this.inputs.replaceChildren(table(['Node', 'Topic', '', 'Received', 'Lost', 'Waiting', 'Dropped', 'Refused', 'Lost samples', 'Silent', 'Latency [ms]', ''], rows, { id: 'health-inputs' }));
  }
}
