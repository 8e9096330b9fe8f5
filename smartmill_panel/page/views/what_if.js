// Sliders of a modified cut, whose chart is computed at once. Commands no machine.
import { deg, fixed, make } from '../format.js';
import { toMm, toRpm } from './chart.js';

const SLIDERS = [
  { key: 'depth', name: 'Axial depth', unit: 'mm', low: 0.1, high: 20, step: 0.1, digits: 1 },
  { key: 'width', name: 'Width of cut', unit: '% of ⌀', low: 2, high: 100, step: 1, digits: 0 },
  { key: 'feed', name: 'Feed per tooth', unit: 'mm', low: 0.01, high: 0.4, step: 0.005, digits: 3 },
  { key: 'teeth', name: 'Teeth', unit: '', low: 1, high: 12, step: 1, digits: 0 },
  { key: 'helix', name: 'Helix', unit: '°', low: 0, high: 60, step: 1, digits: 0 },
  { key: 'overhang', name: 'Overhang ratio', unit: '%', low: 60, high: 160, step: 1, digits: 0 },
];

export class WhatIf {
  constructor(card, link, chart) {
    Object.assign(this, { chart, pending: false, busy: false, times: [] });
    this.base = { depth: 2, width: 100, feed: 0.1, teeth: 4, helix: 30, overhang: 100 };
    this.value = { ...this.base };
    this.changed = new Set();
    this.down = true;
    this.inputs = {};
    this.answer = make('p', { class: 'dim', id: 'what-if-answer' }, 'Move a slider to change the chart.');
    card.append(this.answer);
    for (const s of SLIDERS) {
      const value_text = make('b');
      const input = make('input', { type: 'range', min: s.low, max: s.high, step: s.step, id: `what-if-${s.key}`, 'aria-label': s.name,
        oninput: () => { this.value[s.key] = +input.value; this.changed.add(s.key); this.label(s); this.fetchChart(); } });
      this.inputs[s.key] = { input, value_text };
      card.append(make('label', {}, s.name, value_text, input));
    }
    this.side = make('button', { 'aria-pressed': 'true', onclick: () => { this.down = !this.down; this.side.textContent = this.down ? 'Down-milling' : 'Up-milling'; this.changed.add('width'); this.fetchChart(); } }, 'Down-milling');
    card.append(make('div', { class: 'row' }, this.side, make('button', { onclick: () => this.reset() }, 'Reset')));
    for (const s of SLIDERS) this.label(s);
    link.on('stability/chart', message => {
      this.base.feed = 1e3 * message.feed_per_tooth;
      this.base.depth = message.recommended.length ? 1e3 * message.recommended[0].axial_depth : this.base.depth;
      this.base.width = 50 * (Math.cos(message.entry_angle) - Math.cos(message.exit_angle));
      this.update();
    });
    link.on('cut/condition', message => {
      if (message.teeth) { this.base.teeth = message.teeth; this.base.helix = deg(message.helix); this.update(); }
    });
  }

  // Sliders that were not moved follow the machine.
  update() {
    for (const s of SLIDERS) if (!this.changed.has(s.key)) { this.value[s.key] = this.base[s.key]; this.label(s); }
  }

  label(s) {
    const { input, value_text } = this.inputs[s.key];
    input.value = this.value[s.key];
    value_text.textContent = `${fixed(this.value[s.key], s.digits)} ${s.unit}`;
  }

  reset() {
    this.changed.clear();
    this.update();
    this.chart.setWhatIf(null);
    this.answer.textContent = 'Move a slider to change the chart.';
  }

  // The sliders take the conditions of a test in SI units.
  fill(test) {
    const width = 50 * (Math.cos(test.entry_angle) - Math.cos(test.exit_angle));
    Object.assign(this.value, { depth: 1e3 * test.axial_depth, feed: 1e3 * test.feed_per_tooth, teeth: test.teeth, helix: deg(test.helix), width });
    for (const key of ['depth', 'feed', 'teeth', 'helix', 'width']) this.changed.add(key);
    this.down = test.entry_angle > 0.1;
    this.side.textContent = this.down ? 'Down-milling' : 'Up-milling';
    for (const s of SLIDERS) this.label(s);
    this.fetchChart();
  }

  query() {
    const v = this.value, query = new URLSearchParams({ axial_depth: 1e-3 * v.depth });
    if (this.changed.has('feed')) query.set('feed_per_tooth', 1e-3 * v.feed);
    if (this.changed.has('teeth')) query.set('teeth', v.teeth);
    if (this.changed.has('helix')) query.set('helix', v.helix * Math.PI / 180);
    if (this.changed.has('overhang')) query.set('overhang', v.overhang / 100);
    if (this.changed.has('width')) {
      const arc = Math.acos(1 - 2 * Math.min(1, v.width / 100));
      query.set('entry_angle', this.down ? Math.PI - arc : 0);
      query.set('exit_angle', this.down ? Math.PI : arc);
    }
    return query;
  }

  // One request at a time, then the newest.
  async fetchChart() {
    if (this.busy) { this.pending = true; return; }
    this.busy = true;
    const begin = performance.now();
    const answer = await fetch(`api/what_if?${this.query()}`).catch(() => null);
    const found = await answer?.json().catch(() => null);
    this.busy = false;
    if (!found?.depth_limit) {
      this.answer.textContent = found?.message ?? 'The panel does not answer.';
    } else if (this.changed.size) {
      this.show(found, begin);
    }
    if (this.pending) { this.pending = false; this.fetchChart(); }
  }

  show(found, begin) {
    this.chart.setWhatIf({ speed: toRpm(found.spindle_speed), limit: toMm(found.depth_limit), mode: found.mode, modes: found.modes });
    requestAnimationFrame(() => requestAnimationFrame(() => this.times.push(performance.now() - begin)));
    const counts = new Map();
    for (const mode of found.mode) counts.set(mode, (counts.get(mode) ?? 0) + 1);
    const most = [...counts].filter(([mode]) => mode >= 0).sort((a, b) => b[1] - a[1])[0];
    this.answer.textContent = `${fixed(this.value.depth, 1)} mm is stable at ${fixed(100 * found.stable_share)} % of the speeds` +
      (most ? `, ${found.modes[most[0]]} limits the depth at ${fixed(100 * most[1] / found.mode.length)} %` : '') + ` (${fixed(1e3 * found.seconds)} ms).`;
  }
}
