// Plots on a canvas: lines, bands, points and marks on two axes, cursor, zoom, export.
import { digits, make, save } from './format.js';

const FONT = 12, LEFT = 56, RIGHT = 14, TOP = 10;

export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

// Colour of a share 0..1, also for the colour-blind: blue over grey to yellow, cividis (Nunez, Anderton and Renslow, PLoS ONE 13, 2018).
export function toColour(share) {
  const stops = [[0, 34, 78], [53, 69, 108], [102, 105, 112], [148, 142, 119], [200, 184, 102], [254, 232, 56]];
  const at = 5 * Math.max(0, Math.min(1, share)), k = Math.min(4, Math.floor(at));
  return `rgb(${stops[k].map((low, i) => Math.round(low + (at - k) * (stops[k + 1][i] - low))).join()})`;
}

// Round values between low and high, about `count` of them.
function ticks(low, high, count, least = 0) {
  const rough = Math.max(least, (high - low) / Math.max(1, count));
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 2.5, 5, 10].map(f => f * power).find(s => s >= rough);
  const list = [];
  for (let k = Math.ceil(low / step); k * step <= high * (1 + 1e-12) + 1e-300; ++k) list.push(k * step);
  return list;
}

function decades(low, high) {
  const list = [];
  for (let p = Math.floor(Math.log10(low)); p <= Math.ceil(Math.log10(high)); ++p)
    if (10 ** p >= low * 0.999 && 10 ** p <= high * 1.001) list.push(10 ** p);
  return list;
}

function tickText(value, log) {
  if (log) return value >= 1000 || value < 0.01 ? value.toExponential(0).replace('e+', 'e') : String(value);
  return Math.abs(value) < 1e-12 ? '0' : String(+value.toPrecision(6));
}

const linked = new Map();  // group -> plots

// Buttons that save a plot.
export function exportsOf(plot) {
  return make('div', { class: 'tools' },
    make('button', { title: 'Save as PNG', onclick: () => plot.savePicture() }, 'PNG'),
    make('button', { title: 'Save as CSV', onclick: () => plot.saveNumbers() }, 'CSV'));
}

export function saveCanvas(canvas, name) {
  const copy = make('canvas', { width: canvas.width, height: canvas.height }), c = copy.getContext('2d');
  c.fillStyle = colour('card'); c.fillRect(0, 0, copy.width, copy.height); c.drawImage(canvas, 0, 0);
  copy.toBlob(blob => save(`${name}.png`, blob));
}

export class Plot {
  // options: name (of exported files), x and y: {label, log, low, high}, group: plots with common zoom and cursor,
  // read(x, y): lines of text at the cursor
  constructor(parent, options) {
    this.options = options;
    this.series = []; this.marks = []; this.points = [];
    this.bottom = options.x.hidden ? 8 : 38;
    this.zoom = null;       // [low, high] of x
    this.cursor = null;     // x, y in data
    this.canvas = make('canvas', { tabindex: '0', role: 'img', 'aria-label': options.name });
    this.note = make('div', { class: 'readout', hidden: true });
    this.empty = make('div', { class: 'empty' }, options.empty ?? 'No data yet');
    this.whole = make('button', { class: 'whole', title: 'Show all (Esc, double-click)', hidden: true, onclick: () => this.setZoom(null) }, 'Show all');
    this.frame = make('div', { class: 'plot' }, this.canvas, this.note, this.empty, this.whole, exportsOf(this));
    parent.append(this.frame);
    new ResizeObserver(() => this.dirty()).observe(this.frame);
    this.listen();
    if (options.group) {
      if (!linked.has(options.group)) linked.set(options.group, []);
      linked.get(options.group).push(this);
    }
    document.addEventListener('theme', () => this.dirty());
  }

  // Sets the content {series, marks, points}. series: {x, y, y2, kind: 'line' or 'band', color, label, width, dash,
  // alpha}; y2 of a band. marks: {x or y, label, color}. points: {x, y, label, color, radius, hollow}.
  set(content) {
    Object.assign(this, { series: [], marks: [], points: [] }, content);
    this.dirty();
  }

  dirty() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.draw(); });
  }

  peers() { return this.options.group ? linked.get(this.options.group) : [this]; }
  setZoom(zoom) { for (const plot of this.peers()) { plot.zoom = zoom; plot.dirty(); } }
  setCursor(cursor) {
    for (const plot of this.peers()) { plot.cursor = cursor && (plot === this ? cursor : { x: cursor.x, y: NaN }); plot.dirty(); }
  }

  // ------------------------------------------------------------------------------------------ geometry

  range(axis) {
    const { low, high, log } = this.options[axis];
    if (axis === 'x' && this.zoom) return this.zoom;
    let from = Infinity, to = -Infinity;
    const visible = axis === 'y' ? this.range('x') : null;
    for (const s of this.series) {
      if (s.free) continue;
      for (const values of axis === 'x' ? [s.x] : s.y2 ? [s.y, s.y2] : [s.y]) {
        for (let i = 0; i < values.length; ++i) {
          const v = values[i];
          if (!Number.isFinite(v) || (log && v <= 0)) continue;
          if (visible && (s.x[i] < visible[0] || s.x[i] > visible[1])) continue;
          if (v < from) from = v;
          if (v > to) to = v;
        }
      }
    }
    for (const p of this.points) if (!p.free && Number.isFinite(p[axis])) { from = Math.min(from, p[axis]); to = Math.max(to, p[axis]); }
    if (!(from <= to)) [from, to] = log ? [1, 10] : [0, 1];
    if (axis === 'y' && !log) {
      const margin = 0.06 * (to - from || Math.abs(to) || 1);
      from -= margin; to += margin;
    } else if (axis === 'y') { from /= 1.5; to *= 1.5; }
    if (low !== undefined) from = low;
    if (high !== undefined) to = Math.min(high, Math.max(to, from + 1e-9));
    return [from, to > from ? to : from + 1];
  }

  measure() {
    const width = this.frame.clientWidth, height = this.frame.clientHeight;
    const [x0, x1] = this.range('x'), [y0, y1] = this.range('y');
    const scale = (log, from, to, begin, end) => {
      if (!log) return { to: v => begin + (v - from) / (to - from) * (end - begin), back: p => from + (p - begin) / (end - begin) * (to - from) };
      const a = Math.log(from), b = Math.log(to);
      return { to: v => begin + (Math.log(Math.max(v, 1e-300)) - a) / (b - a) * (end - begin), back: p => Math.exp(a + (p - begin) / (end - begin) * (b - a)) };
    };
    return { width, height, x0, x1, y0, y1,
      x: scale(this.options.x.log, x0, x1, LEFT, width - RIGHT), y: scale(this.options.y.log, y0, y1, height - this.bottom, TOP) };
  }

  // ------------------------------------------------------------------------------------------ drawing

  draw() {
    if (!this.frame.clientWidth || !this.frame.clientHeight) return;
    const g = this.geometry = this.measure(), ratio = window.devicePixelRatio || 1;
    const pixels = [Math.round(g.width * ratio), Math.round(g.height * ratio)];
    if (this.canvas.width !== pixels[0] || this.canvas.height !== pixels[1]) [this.canvas.width, this.canvas.height] = pixels;
    const c = this.canvas.getContext('2d');
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, g.width, g.height);
    const something = this.series.length > 0;
    this.whole.hidden = !this.zoom;
    this.empty.hidden = something;
    this.canvas.dataset.drawn = something ? 'yes' : 'no';
    c.font = `${FONT}px ${getComputedStyle(document.body).fontFamily}`;
    if (!something) return this.showNote(g);
    this.drawAxes(c, g);
    c.save();
    c.beginPath();
    c.rect(LEFT, TOP, g.width - LEFT - RIGHT, g.height - TOP - this.bottom);
    c.clip();
    for (const s of this.series) s.kind === 'band' ? this.drawBand(c, g, s) : this.drawLine(c, g, s);
    this.drawMarks(c, g);
    for (const p of this.points) this.drawPoint(c, g, p);
    if (this.cursor) this.drawCursor(c, g);
    c.restore();
    this.drawLegend(c, g);
    this.showNote(g);
  }

  drawAxes(c, g) {
    const { x, y } = this.options;
    c.strokeStyle = colour('grid'); c.fillStyle = colour('dim'); c.lineWidth = 1;
    c.textAlign = 'center'; c.textBaseline = 'top';
    for (const t of x.log ? decades(g.x0, g.x1) : ticks(g.x0, g.x1, (g.width - LEFT) / 90, x.least)) {
      const p = Math.round(g.x.to(t)) + 0.5;
      c.beginPath(); c.moveTo(p, TOP); c.lineTo(p, g.height - this.bottom); c.stroke();
      if (x.hidden) continue;
      const text = x.text ? x.text(t) : tickText(t, x.log), half = c.measureText(text).width / 2;
      c.fillText(text, Math.min(p, g.width - 2 - half), g.height - this.bottom + 5);
    }
    c.textAlign = 'right'; c.textBaseline = 'middle';
    for (const t of y.log ? decades(g.y0, g.y1) : ticks(g.y0, g.y1, Math.max(2, (g.height - TOP - this.bottom) / 45))) {
      const p = Math.round(g.y.to(t)) + 0.5;
      c.beginPath(); c.moveTo(LEFT, p); c.lineTo(g.width - RIGHT, p); c.stroke();
      c.fillText(tickText(t, y.log), LEFT - 6, p);
    }
    c.textAlign = 'right'; c.textBaseline = 'bottom';
    c.save();
    c.translate(11, TOP);
    c.rotate(-Math.PI / 2);
    c.textAlign = 'right'; c.textBaseline = 'middle';
    c.fillText(y.label, 0, 0);
    c.restore();
  }

  drawLine(c, g, s) {
    c.strokeStyle = s.color; c.globalAlpha = s.alpha ?? 1; c.lineWidth = s.width ?? 1.6; c.lineJoin = 'round';
    c.setLineDash(s.dash ?? []);
    c.beginPath();
    let pen = false;
    for (let i = 0; i < s.x.length; ++i) {
      const v = s.y[i];
      if (!Number.isFinite(v)) { pen = false; continue; }
      const px = g.x.to(s.x[i]), py = Math.max(-1e4, Math.min(1e4, g.y.to(v)));
      if (pen) c.lineTo(px, py); else c.moveTo(px, py);
      pen = true;
    }
    c.stroke();
    c.setLineDash([]); c.globalAlpha = 1;
  }

  drawBand(c, g, s) {
    c.fillStyle = s.color; c.globalAlpha = s.alpha ?? 0.2;
    const clamp = v => Math.max(-1e4, Math.min(1e4, v));
    // Segments without gaps, each at least one pixel high.
    for (let i = 0; i < s.x.length;) {
      if (!Number.isFinite(s.y[i]) || !Number.isFinite(s.y2[i])) { ++i; continue; }
      let end = i;
      while (end < s.x.length && Number.isFinite(s.y[end]) && Number.isFinite(s.y2[end])) ++end;
      c.beginPath();
      for (let k = i; k < end; ++k) c.lineTo(g.x.to(s.x[k]), clamp(g.y.to(s.y[k])) + 0.5);
      for (let k = end - 1; k >= i; --k) c.lineTo(g.x.to(s.x[k]), clamp(g.y.to(s.y2[k])) - 0.5);
      c.closePath(); c.fill();
      i = end;
    }
    c.globalAlpha = 1;
  }

  drawMarks(c, g) {
    c.textBaseline = 'top'; c.textAlign = 'left';
    const ends = [-1e9, -1e9, -1e9];  // of the labels in each row; a label without space is omitted
    for (const m of [...this.marks].sort((a, b) => (a.x ?? 0) - (b.x ?? 0))) {
      c.strokeStyle = c.fillStyle = m.color ?? colour('dim');
      c.lineWidth = m.width ?? 1;
      c.setLineDash(m.dash ?? [4, 4]);
      c.beginPath();
      if (m.x !== undefined) {
        const p = g.x.to(m.x);
        if (p < LEFT || p > g.width - RIGHT) continue;
        c.moveTo(p, TOP); c.lineTo(p, g.height - this.bottom);
        const row = m.label ? ends.findIndex(end => end < p) : -1;
        if (row >= 0) {
          const wide = c.measureText(m.label).width, tint = c.fillStyle;
          ends[row] = p + 8 + wide;
          c.fillStyle = colour('card'); c.globalAlpha = 0.75;
          c.fillRect(p + 2, TOP + 1 + row * (FONT + 2), wide + 4, FONT + 2);
          c.fillStyle = tint; c.globalAlpha = 1;
          c.fillText(m.label, p + 4, TOP + 2 + row * (FONT + 2));
        }
      } else {
        const p = g.y.to(m.y);
        c.moveTo(LEFT, p); c.lineTo(g.width - RIGHT, p);
        if (m.label) c.fillText(m.label, LEFT + 6, p + 3);
      }
      c.stroke();
    }
    c.setLineDash([]);
  }

  drawPoint(c, g, p) {
    const px = g.x.to(p.x), py = g.y.to(p.y), r = p.radius ?? 5;
    c.beginPath(); c.arc(px, py, r, 0, 2 * Math.PI);
    c.lineWidth = 2; c.strokeStyle = p.hollow ? p.color : colour('card'); c.fillStyle = p.color;
    if (!p.hollow) c.fill();
    c.stroke();
    if (!p.label) return;
    c.textBaseline = 'bottom'; c.textAlign = px > g.width - 120 ? 'right' : 'left'; c.fillStyle = colour('text');
    c.fillText(p.label, px + (c.textAlign === 'left' ? r + 4 : -r - 4), py - 2);
  }

  drawCursor(c, g) {
    c.strokeStyle = colour('dim'); c.lineWidth = 1;
    c.beginPath();
    const px = g.x.to(this.cursor.x);
    c.moveTo(px, TOP); c.lineTo(px, g.height - this.bottom);
    c.stroke();
  }

  drawLegend(c, g) {
    if (this.options.x.hidden) return;
    const named = this.series.filter(s => s.label);
    c.textBaseline = 'middle'; c.textAlign = 'left';
    let at = LEFT;
    for (const s of named) {
      if (at + 19 + c.measureText(s.label).width > g.width) continue;
      c.fillStyle = s.color;
      c.fillRect(at, g.height - 13, 14, 4);
      c.fillStyle = colour('dim');
      c.fillText(s.label, at + 19, g.height - 10);
      at += 34 + c.measureText(s.label).width;
    }
    this.labelX(c, g, at);
  }

  // Only if the legend leaves enough space.
  labelX(c, g, from) {
    const { label, hidden } = this.options.x;
    if (hidden || g.width - RIGHT - c.measureText(label).width < from) return;
    c.textAlign = 'right'; c.textBaseline = 'bottom'; c.fillStyle = colour('dim');
    c.fillText(label, g.width - RIGHT, g.height - 2);
  }

  showNote(g) {
    const inside = this.cursor && Number.isFinite(this.cursor.y) && this.options.read;
    const lines = inside ? this.options.read(this.cursor.x, this.cursor.y) : [];
    this.note.hidden = !lines.length;
    if (!lines.length) return;
    this.note.replaceChildren(...lines.map(line => make('div', {}, line)));
    this.note.style[g.x.to(this.cursor.x) > g.width / 2 ? 'right' : 'left'] = '72px';
    this.note.style[g.x.to(this.cursor.x) > g.width / 2 ? 'left' : 'right'] = 'auto';
  }

  // ------------------------------------------------------------------------------------------ input

  listen() {
    const place = event => {
      const box = this.canvas.getBoundingClientRect(), g = this.geometry;
      return g && { x: g.x.back(event.clientX - box.left), y: g.y.back(event.clientY - box.top) };
    };
    let from = null;
    this.canvas.addEventListener('pointerdown', event => { from = place(event); this.moved = false; });
    this.canvas.addEventListener('pointermove', event => {
      const at = place(event);
      if (!at) return;
      if (from && Math.abs(this.geometry.x.to(at.x) - this.geometry.x.to(from.x)) > 12) this.moved = true;
      this.setCursor(at);
    });
    this.canvas.addEventListener('pointerup', event => {
      const at = place(event);
      if (from && this.moved && at) this.setZoom([Math.min(from.x, at.x), Math.max(from.x, at.x)]);
      else if (from && at && this.options.pick) this.options.pick(at.x, at.y);
      from = null;
    });
    this.canvas.addEventListener('pointerleave', () => { from = null; this.setCursor(null); });
    this.canvas.addEventListener('dblclick', () => this.setZoom(null));
    this.canvas.addEventListener('wheel', event => {
      const at = place(event);
      if (!at) return;
      event.preventDefault();
      const [low, high] = this.range('x'), factor = event.deltaY > 0 ? 1.25 : 0.8;
      const zoom = [at.x - (at.x - low) * factor, at.x + (high - at.x) * factor];
      this.setZoom(this.zoom === null && factor > 1 ? null : zoom);
    }, { passive: false });
    this.canvas.addEventListener('keydown', event => { if (event.key === 'Escape') this.setZoom(null); });
  }

  savePicture() { saveCanvas(this.canvas, this.options.name); }

  csv() {
    const lines = [`series,${this.options.x.label},${this.options.y.label},upper end`];
    for (const s of this.series)
      for (let i = 0; i < s.x.length; ++i) lines.push(`${s.label ?? ''},${s.x[i]},${s.y[i]},${s.y2 ? s.y2[i] : ''}`);
    for (const p of this.points) lines.push(`${(p.label ?? 'point').replaceAll(',', ' ')},${p.x},${p.y},`);
    return lines.join('\n') + '\n';
  }
  saveNumbers() { save(`${this.options.name}.csv`, this.csv(), 'text/csv'); }
}

// Spectrum over time: one column per spectrum, brighter is larger.
export class Waterfall {
  constructor(parent, columns = 300) {
    this.columns = columns;
    this.canvas = make('canvas', { role: 'img', 'aria-label': 'waterfall' });
    this.empty = make('div', { class: 'empty' }, 'No data yet');
    this.label = make('div', { class: 'axis' });
    parent.append(make('div', { class: 'plot' }, this.canvas, this.empty, this.label, exportsOf(this)));
    this.image = make('canvas');
    this.lines = [];  // shown amplitudes with their times
  }
  // amplitudes at a time [s], up to highest [Hz]
  push(amplitudes, highest, time) {
    this.lines.push({ time, highest, amplitudes });
    if (this.lines.length > this.columns) this.lines.shift();
    const image = this.image, rows = amplitudes.length;
    if (image.height !== rows || image.width !== this.columns) { image.width = this.columns; image.height = rows; this.peak = 0; }
    const c = image.getContext('2d');
    c.drawImage(image, -1, 0);
    let peak = 1e-6;
    for (const a of amplitudes) if (a > peak) peak = a;
    this.peak = Math.max(peak, 0.98 * (this.peak || 0));
    const column = c.createImageData(1, rows), tint = [90, 169, 255];
    for (let k = 0; k < rows; ++k) {
      const level = Math.max(0, 1 + Math.log10(Math.max(amplitudes[k], 1e-9) / this.peak) / 3);  // 60 dB
      const at = 4 * (rows - 1 - k);
      for (let i = 0; i < 3; ++i) column.data[at + i] = level < 0.75 ? tint[i] * level / 0.75 : tint[i] + (255 - tint[i]) * (level - 0.75) * 4;
      column.data[at + 3] = 255;
    }
    c.putImageData(column, this.columns - 1, 0);
    this.label.textContent = `0 to ${digits(highest / 1000, 2)} kHz from bottom to top, 60 dB, newest on the right`;
    this.empty.hidden = true;
    this.dirty = true;
  }
  draw() {
    if (!this.dirty || !this.canvas.clientWidth) return;
    this.dirty = false;
    [this.canvas.width, this.canvas.height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const c = this.canvas.getContext('2d');
    c.imageSmoothingEnabled = false;
    c.drawImage(this.image, 0, 0, this.canvas.width, this.canvas.height);
    this.canvas.dataset.drawn = 'yes';
  }
  savePicture() { saveCanvas(this.canvas, 'waterfall'); }
  csv() {
    const count = this.lines.at(-1)?.amplitudes.length ?? 0, step = (this.lines.at(-1)?.highest ?? 0) / count;
    const head = Array.from({ length: count }, (_, k) => `${((k + 0.5) * step).toPrecision(6)} Hz`);
    return [`time [s],${head.join()}`, ...this.lines.map(l => `${l.time},${Array.from(l.amplitudes, a => a.toPrecision(4)).join()}`)].join('\n') + '\n';
  }
  saveNumbers() { save('waterfall.csv', this.csv(), 'text/csv'); }
}
