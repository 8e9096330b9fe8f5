// Forces: over one revolution, over time, over frequency.
import { clock, digits, fixed, make, rpm } from '../format.js';
import { Plot, Waterfall, colour } from '../plot.js';

const MEASURED = 0, COMPENSATED = 1, TWIN = 2;
const SOURCES = ['raw', 'compensated', 'twin'];
const AXES = ['x', 'y', 'z'];
const MINUTE = 60;

// Buttons with one pressed; all groups with the same key are synchronised.
function choice(card, store, key, values, changed) {
  const buttons = values.map(([value, name]) => make('button', { onclick: () => {
    store[key] = value;
    document.dispatchEvent(new CustomEvent('choice'));
  } }, name));
  const update = () => buttons.forEach((b, k) => b.setAttribute('aria-pressed', String(store[key] === values[k][0])));
  document.addEventListener('choice', () => { update(); changed(); });
  update();
  card.querySelector('h2').append(make('span', { class: 'choice row' }, ...buttons));
}

// The newest message of each source; without a steady cut, that of the last steady cut.
class Newest {
  constructor() { this.all = {}; this.cut = {}; }
  add(message) {
    this.all[message.source] = message;
    if (message.steady) this.cut[message.source] = message;
    this.cutting = message.steady;
  }
  get(source) { return (this.cutting ? this.all : this.cut)[source] ?? this.all[source]; }
}

const axes = AXES.map(a => [a, a]);
const ofAxis = (list, axis, n) => list.subarray(AXES.indexOf(axis) * n, (AXES.indexOf(axis) + 1) * n);

export class Revolution {
  constructor(card, link, store, choices = true) {
    Object.assign(this, { card, link, store, found: new Newest() });
    if (choices) choice(card, store, 'axis', axes, () => this.draw());
    else document.addEventListener('choice', () => this.draw());
    this.plot = new Plot(card, { name: 'revolution', x: { label: 'Spindle angle [°]', low: 0, high: 360 }, y: { label: 'Force [N]' },
      empty: 'No force yet: it is shown from the first cut on', read: (x, y) => [`${fixed(x)}°`, `${digits(y)} N`] });
    link.on('panel/revolution', message => { this.found.add(message); this.news = true; });
    link.on('cut/condition', () => {});
  }

  draw() {
    const { axis } = this.store, series = [], marks = [];
    const newest = this.found.get(COMPENSATED) ?? this.found.get(MEASURED), teeth = this.link.message('cut/condition')?.teeth;
    const styles = { [MEASURED]: { color: colour('measured'), width: 1.3 }, [COMPENSATED]: { color: colour(axis), width: 2.4 }, [TWIN]: { color: colour('twin'), width: 1.8, dash: [6, 4] } };
    for (const source of [MEASURED, COMPENSATED, TWIN]) {
      const m = this.found.get(source);
      if (!m || (source === TWIN && m.condition !== newest?.condition)) continue;
      const n = m.bins, x = Array.from({ length: n }, (_, k) => (k + 0.5) * 360 / n);
      if (source === COMPENSATED) series.push({ kind: 'band', x, y: ofAxis(m.low, axis, n), y2: ofAxis(m.high, axis, n), color: colour(axis), alpha: 0.22 });
      series.push({ x, y: ofAxis(m.mean, axis, n), label: SOURCES[source], ...styles[source] });
    }
    if (newest) {
      for (let k = 0; k < (teeth || 0); ++k) marks.push({ x: (360 - 360 * k / teeth) % 360, label: `tooth ${k + 1}` });
      this.card.aside.textContent = `${newest.steady ? '' : 'not cutting, '}${newest.condition ? newest.condition + ', ' : ''}${fixed(rpm(newest.spindle_speed))} rpm`;
    }
    this.plot.set({ series, marks });
  }
  refresh() { if (this.news) { this.news = false; this.draw(); } }
  onShow() { this.draw(); }
}

export class Spectrum {
  constructor(card, link, store) {
    Object.assign(this, { card, link, store, found: new Newest() });
    choice(card, store, 'axis', axes, () => this.draw());
    choice(card, store, 'source', [[MEASURED, 'raw'], [COMPENSATED, 'compensated']], () => this.draw());
    this.plot = new Plot(card, { name: 'spectrum', x: { label: 'Frequency [Hz]', low: 0 }, y: { label: 'Amplitude [N]', log: true },
      empty: 'No force yet: it is shown from the first cut on', read: (x, y) => this.read(x, y) });
    link.on('panel/spectrum', message => { this.found.add(message); this.news = true; });
    link.on('tool/modes', message => { if (message.point === 'tool_tip') this.modes = { ...this.modes, [message.direction]: message.modes }; });
    link.on('chatter/state', () => {});
  }

  marks(m) {
    const marks = [], turn = m.spindle_speed / (2 * Math.PI);
    if (turn > 0.5) {
      if (m.teeth > 1) marks.push({ x: turn, label: 'spindle' });
      for (let k = 1; k <= 4 && m.teeth; ++k) marks.push({ x: k * turn * m.teeth, label: k === 1 ? 'tooth' : `${k}×`, color: colour('text') });
    }
    for (const [direction, modes] of Object.entries(this.modes ?? {}))
      for (const mode of modes) marks.push({ x: mode.frequency, label: `mode ${direction}`, color: colour(direction), dash: [2, 3] });
    const chatter = this.link.message('chatter/state');
    if (chatter?.chatter && m.steady) marks.push({ x: chatter.frequency, label: `chatter ${fixed(chatter.frequency)} Hz`, color: colour('bad'), width: 2, dash: [] });
    return marks;
  }

  draw() {
    const m = this.found.get(this.store.source) ?? this.found.get(MEASURED);
    if (!m) return this.plot.set({});
    const y = m[`f${this.store.axis}`], x = Array.from(y, (_, k) => (k + 0.5) * m.step);
    let peak = 0;
    for (const v of y) peak = Math.max(peak, v);
    this.plot.options.y.low = Math.max(1e-4, peak / 2000);
    this.plot.set({ series: [{ x, y, color: colour(this.store.axis), width: 1.4 }], marks: this.marks(m) });
    this.card.aside.textContent = `${m.steady ? '' : 'not cutting, '}${m.condition}`;
  }
  read(x, y) {
    const m = this.found.get(this.store.source) ?? this.found.get(MEASURED);
    if (!m) return [];
    const line = m[`f${this.store.axis}`][Math.floor(x / m.step)], turn = m.spindle_speed / (2 * Math.PI);
    return [`${fixed(x, 1)} Hz: ${digits(line)} N`, turn > 0.5 ? `order ${fixed(x / turn, 2)}` : ''];
  }
  refresh() { if (this.news) { this.news = false; this.draw(); } }
  onShow() { this.draw(); }
}

export class SpectrumCourse {
  constructor(card, link, store) {
    this.waterfall = new Waterfall(card);
    link.on('panel/spectrum', message => {
      if (message.source !== store.source) return;
      this.waterfall.push(message[`f${store.axis}`], message.step * message.fx.length, message.header.stamp);
    });
  }
  refresh() { this.waterfall.draw(); }
  onShow() { this.waterfall.dirty = this.waterfall.empty.hidden; }
}

// Merges neighbouring bins of a strip until there are at most as many as columns.
export function reduced(bins, columns) {
  if (bins.x.length <= columns) return bins;
  const step = Math.ceil(bins.x.length / columns), out = { x: [], low: [], high: [] };
  for (let i = 0; i < bins.x.length; i += step) {
    let low = NaN, high = NaN;
    for (let k = i; k < Math.min(i + step, bins.x.length); ++k) {
      if (!(bins.low[k] >= low)) low = Number.isNaN(bins.low[k]) ? low : bins.low[k];
      if (!(bins.high[k] <= high)) high = Number.isNaN(bins.high[k]) ? high : bins.high[k];
    }
    out.x.push(bins.x[i]); out.low.push(low); out.high.push(high);
  }
  return out;
}

export class Strips {
  // notes: has a list of {time, text}
  constructor(card, link, store, notes) {
    Object.assign(this, { card, link, store, notes, strips: [], paused: false });
    choice(card, store, 'source', [[MEASURED, 'raw'], [COMPENSATED, 'compensated'], [TWIN, 'twin']], () => this.draw());
    const pause = make('button', { onclick: () => { this.paused = !this.paused; pause.textContent = this.paused ? 'Resume' : 'Pause'; this.draw(); } }, 'Pause');
    card.querySelector('h2').append(make('span', { class: 'choice row' }, pause));
    this.plots = AXES.map(axis => new Plot(card, { name: `strip_${axis}`, group: 'strips', x: { label: 'Time', text: clock, least: 1, hidden: axis !== 'z' }, y: { label: `F${axis} [N]` },
      empty: 'No force yet: it is shown from the first cut on', read: (x, y) => [clock(x), `${digits(y)} N`] }));
    for (const plot of this.plots) plot.frame.style.minHeight = '76px';
    link.on('panel/strip', message => this.addStrip(message));
    link.on('replay/state', message => {
      if (message.position < this.position) this.strips = [];
      this.position = message.position;
    });
  }

  // Latched messages may arrive in any order.
  addStrip(strip) {
    const begin = strip.header.stamp, last = this.strips.at(-1)?.header.stamp;
    this.strips.push(strip);
    if (begin < last) this.strips.sort((a, b) => a.header.stamp - b.header.stamp);
    const newest = this.strips.at(-1).header.stamp;
    while (this.strips.length && this.strips[0].header.stamp < newest - MINUTE) this.strips.shift();
    this.news = true;
  }

  bins(axis) {
    const k = AXES.indexOf(axis), x = [], low = [], high = [];
    let end = -Infinity;
    for (const s of this.strips) {
      if (s.source !== this.store.source) continue;
      if (s.header.stamp > end + s.bin) { x.push(end); low.push(NaN); high.push(NaN); }
      for (let i = 0; 3 * i < s.low.length; ++i) { x.push(s.header.stamp + i * s.bin); low.push(s.low[3 * i + k]); high.push(s.high[3 * i + k]); }
      end = s.header.stamp + s.low.length / 3 * s.bin;
    }
    if (x[0] === -Infinity) { x.shift(); low.shift(); high.shift(); }
    return { x, low, high };
  }

  draw() {
    AXES.forEach((axis, k) => {
      const bins = reduced(this.bins(axis), Math.max(200, this.plots[k].frame.clientWidth));
      this.plots[k].set({ marks: this.notes.list.map(n => ({ x: n.time, label: k === 0 ? n.text : '', color: colour('warn') })),
        series: bins.x.length ? [{ kind: 'band', x: bins.x, y: bins.low, y2: bins.high, color: colour(axis), alpha: 0.85 }] : [] });
    });
  }
  refresh() { if (this.news && !this.paused) { this.news = false; this.draw(); } }
  onShow() { this.draw(); }
}
