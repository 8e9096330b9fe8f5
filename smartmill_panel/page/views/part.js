// The part: tool path of the running program from above, coloured by what is predicted or measured, the tool, and the lines to look at.
import { digits, fixed, make, save, table } from '../format.js';
import { colour, exportsOf, saveCanvas, toColour } from '../plot.js';

const CUT = 2, MM = 1e3;
const QUANTITIES = {
  measured: { name: 'Measured peak force', unit: 'N' },
  predicted: { name: 'Predicted peak force', unit: 'N' },
  ratio: { name: 'Measured over predicted', unit: '', low: 0.5, high: 1.5 },
  margin: { name: 'Stability margin', unit: '', low: 0.5, high: 3 },
};
const DIFFERENCE = 0.25;  // [1] of measured from predicted, above which a line is listed
const LISTED = 30;        // lines

export class Part {
  constructor(card, lines_card, link, store) {
    Object.assign(this, { card, link, store, path: null, shown: null, part: 0 });
    this.clear();
    this.choice = make('select', { id: 'part-quantity', 'aria-label': 'Quantity', onchange: () => { this.store.quantity = this.choice.value; this.draw(); } },
      ...Object.entries(QUANTITIES).map(([key, q]) => make('option', { value: key }, q.name)));
    this.choice.value = QUANTITIES[store.quantity] ? store.quantity : 'measured';
    this.whole = make('button', { title: 'Show all (double-click)', onclick: () => this.showAll() }, 'Show all');
    this.scale = make('span', { class: 'dim', id: 'part-scale' });
    this.canvas = make('canvas', { id: 'part-path', role: 'img', 'aria-label': 'tool path from above', style: 'width: 100%; height: 100%; cursor: grab' });
    this.drawing = document.createElement('canvas');  // the path without the tool, which moves more often
    this.frame = make('div', { class: 'plot' }, this.canvas);
    this.empty = make('div', { class: 'empty' }, 'No program is followed: machine.launch program:=FILE');
    this.frame.append(this.empty, exportsOf(this));
    card.append(make('div', { class: 'row' }, this.choice, this.whole, this.scale), this.frame);
    this.lines = make('div', { class: 'dim scroll' }, 'No line yet');
    lines_card.append(this.lines);
    new ResizeObserver(() => this.draw()).observe(this.frame);
    document.addEventListener('theme', () => this.draw());
    this.listen();
    link.on('program/path', m => this.setPath(m));
    link.on('program/progress', m => this.add(m));
    link.on('cnc/state', () => {});
  }

  listen() {
    this.canvas.addEventListener('wheel', event => {
      event.preventDefault();
      if (!this.shown) return;
      const at = this.toData(event.offsetX, event.offsetY), factor = 1.2 ** (event.deltaY < 0 ? 1 : -1);
      this.shown.scale *= factor;
      this.shown.x = at[0] - (at[0] - this.shown.x) / factor;
      this.shown.y = at[1] - (at[1] - this.shown.y) / factor;
      this.draw();
    }, { passive: false });
    this.canvas.addEventListener('pointermove', event => {
      if (!(event.buttons & 1) || !this.shown) return;
      this.shown.x -= event.movementX / this.shown.scale;
      this.shown.y += event.movementY / this.shown.scale;
      this.draw();
    });
    this.canvas.addEventListener('dblclick', () => this.showAll());
  }

  setPath(message) {
    const same = this.path && this.path.program === message.program && this.path.line.length === message.line.length;
    this.path = message;
    if (!same) {
      this.clear();
      this.shown = null;
    }
    this.draw();
  }

  // A new part begins.
  clear() {
    this.measured = new Float64Array(this.path?.line.length ?? 0).fill(NaN);
    this.chatter = new Map();  // line -> frequency [Hz]; null: judged stable
    this.found = new Map();    // line -> {measured, predicted, margin}
  }

  // Pieces between two places: [first, end).
  between(from, to) {
    const { place } = this.path;
    let low = 0, high = place.length - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (place[middle + 1] > from) high = middle; else low = middle + 1;
    }
    let end = low;
    while (end < place.length - 1 && place[end] < to) ++end;
    return [low, end];
  }

  add(m) {
    if (!this.path || m.program !== this.path.program) return;
    if (m.part !== this.part) { this.part = m.part; this.clear(); }
    const [first, end] = this.between(m.from_place, m.to_place);
    for (let k = first; k < end; ++k)
      if (this.path.kind[k] === CUT && !(m.peak_force <= this.measured[k])) this.measured[k] = m.peak_force;
    if (Number.isFinite(m.predicted_peak_force) || m.judged) {
      const line = this.found.get(m.last_line) ?? { measured: NaN, predicted: NaN, margin: NaN };
      if (!(m.peak_force <= line.measured)) line.measured = m.peak_force;
      if (!(m.predicted_peak_force <= line.predicted)) line.predicted = m.predicted_peak_force;
      if (!(m.stability_margin >= line.margin)) line.margin = m.stability_margin;
      this.found.set(m.last_line, line);
    }
    if (m.chatter) this.chatter.set(m.last_line, m.chatter_frequency);
    else if (m.judged && !this.chatter.has(m.last_line)) this.chatter.set(m.last_line, null);
    this.compensated = m.compensated;
    this.changed = true;
  }

  value(k) {
    const predicted = this.path.peak_force[k];
    switch (this.choice.value) {
      case 'predicted': return predicted;
      case 'ratio': return this.measured[k] / predicted;
      case 'margin': return this.path.stability_margin[k];
      default: return this.measured[k];
    }
  }

  showAll() {
    this.shown = null;
    this.draw();
  }

  // The view of all cuts; without cuts, of the whole path.
  wholeView() {
    const cut = Array.from(this.path.kind, (kind, k) => kind === CUT ? k : -1).filter(k => k >= 0);
    const xs = cut.flatMap(k => [this.path.x[k], this.path.x[k + 1]]), ys = cut.flatMap(k => [this.path.y[k], this.path.y[k + 1]]);
    const range = list => list.reduce(([low, high], v) => [Math.min(low, v), Math.max(high, v)], [Infinity, -Infinity]);
    const [x0, x1] = range(xs.length ? xs : Array.from(this.path.x)), [y0, y1] = range(ys.length ? ys : Array.from(this.path.y));
    const width = Math.max(x1 - x0, 1e-3), height = Math.max(y1 - y0, 1e-3);
    return { x: (x0 + x1) / 2, y: (y0 + y1) / 2, scale: 0.85 * Math.min(this.frame.clientWidth / width, this.frame.clientHeight / height) };
  }

  toPixel(x, y) {
    return [this.frame.clientWidth / 2 + (x - this.shown.x) * this.shown.scale, this.frame.clientHeight / 2 - (y - this.shown.y) * this.shown.scale];
  }
  toData(px, py) {
    return [this.shown.x + (px - this.frame.clientWidth / 2) / this.shown.scale, this.shown.y - (py - this.frame.clientHeight / 2) / this.shown.scale];
  }

  // Colour scale: fixed for ratios, from 0 to the largest of prediction and measurement for forces.
  limits() {
    const quantity = QUANTITIES[this.choice.value];
    if (quantity.high) return [quantity.low, quantity.high];
    let high = 0;
    for (let k = 0; k < this.path.line.length; ++k)
      for (const value of [this.path.peak_force[k], this.measured[k]]) if (value > high) high = value;
    return [0, high || 1];
  }

  draw() {
    this.empty.hidden = Boolean(this.path);
    const width = this.frame.clientWidth, height = this.frame.clientHeight;
    if (!this.path?.line.length || !width || !height) return;
    this.shown ??= this.wholeView();
    const ratio = devicePixelRatio || 1, c = this.drawing.getContext('2d');
    for (const canvas of [this.drawing, this.canvas]) Object.assign(canvas, { width: width * ratio, height: height * ratio });
    c.scale(ratio, ratio);
    const [low, high] = this.limits(), quantity = QUANTITIES[this.choice.value];
    this.scale.textContent = `${quantity.name} ${digits(low)} to ${digits(high)} ${quantity.unit}, grey: ${this.choice.value === 'measured' || this.choice.value === 'ratio' ? 'not cut yet' : 'not predicted'}`;
    const line = (k, style, thick) => {
      c.strokeStyle = style;
      c.lineWidth = thick;
      c.beginPath();
      c.moveTo(...this.toPixel(this.path.x[k], this.path.y[k]));
      c.lineTo(...this.toPixel(this.path.x[k + 1], this.path.y[k + 1]));
      c.stroke();
    };
    c.lineCap = 'round';
    const dim = colour('line'), unknown = colour('dim');
    for (let k = 0; k < this.path.line.length; ++k) if (this.path.kind[k] !== CUT) line(k, dim, 0.5);
    for (let k = 0; k < this.path.line.length; ++k) {
      if (this.path.kind[k] !== CUT) continue;
      const value = this.value(k);
      line(k, Number.isFinite(value) ? toColour((value - low) / (high - low)) : unknown, Number.isFinite(value) ? 4 : 2);
    }
    this.drawTool();
    this.canvas.dataset.drawn = 'yes';
  }

  drawTool() {
    if (!this.shown || !this.drawing.width) return;
    const ratio = devicePixelRatio || 1, c = this.canvas.getContext('2d');
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, this.canvas.width, this.canvas.height);
    c.drawImage(this.drawing, 0, 0);
    c.scale(ratio, ratio);
    const state = this.link.message('cnc/state');
    const axis = name => state?.axes.findIndex(a => a.toUpperCase() === name) ?? -1;
    const x = axis('X'), y = axis('Y');
    if (x < 0 || y < 0) return;
    const condition = this.link.message('cut/condition');
    const radius = Math.max(5, (condition?.diameter ?? 0) / 2 * this.shown.scale);
    c.strokeStyle = colour('warn');
    c.lineWidth = 2;
    c.beginPath();
    c.arc(...this.toPixel(state.position[x], state.position[y]), radius, 0, 2 * Math.PI);
    c.stroke();
  }

  drawLines() {
    const notable = [...this.found].map(([line, f]) => {
      const chatter = this.chatter.get(line), ratio = f.measured / f.predicted, reasons = [];
      if (chatter) reasons.push(make('span', { class: 'word bad' }, `chatter at ${fixed(chatter)} Hz`));
      if (f.margin < 1) reasons.push(make('span', { class: 'word warn' }, 'predicted to chatter'));
      if (Math.abs(ratio - 1) > DIFFERENCE) reasons.push(make('span', { class: 'word warn' }, ratio > 1 ? 'more force than predicted' : 'less force than predicted'));
      return { line, f, ratio, reasons, weight: (chatter ? 100 : 0) + Math.abs(Math.log(ratio || 1)) };
    }).filter(l => l.reasons.length).sort((a, b) => b.weight - a.weight).slice(0, LISTED);
    if (!notable.length) {
      this.lines.className = 'dim scroll';
      return this.lines.replaceChildren(this.found.size ? `${this.found.size} lines cut, each as predicted` : 'No line yet');
    }
    this.lines.className = 'scroll';
    this.lines.replaceChildren(table(['Line', '', 'Measured [N]', 'Predicted [N]', 'Ratio', 'Margin'], notable.map(l => [
      l.line, make('span', {}, ...l.reasons), fixed(l.f.measured), fixed(l.f.predicted), fixed(l.ratio, 2), fixed(l.f.margin, 2)]), { id: 'part-lines' }));
  }

  savePicture() { saveCanvas(this.canvas, 'part'); }
  csv() {
    const { place, x, y, z, line, kind, peak_force, stability_margin } = this.path ?? { line: [] };
    const rows = Array.from(line, (number, k) => [number, kind[k] === CUT ? 1 : 0, place[k], place[k + 1], x[k], y[k], z[k], x[k + 1], y[k + 1], z[k + 1],
      this.measured[k], peak_force[k], stability_margin[k]].map(v => Number.isFinite(v) ? v : '').join());
    return ['line,cut,from [m],to [m],x [m],y [m],z [m],end x [m],end y [m],end z [m],measured [N],predicted [N],margin', ...rows].join('\n') + '\n';
  }
  saveNumbers() { save('part.csv', this.csv(), 'text/csv'); }

  refresh() {
    const state = this.link.message('cnc/state'), at = JSON.stringify(state?.position);
    if (!this.path || (at === this.drawn_at && !this.changed)) return;
    this.drawn_at = at;
    if (!this.changed) return this.drawTool();
    this.changed = false;
    this.draw();
    this.card.aside.textContent = this.compensated ? '' : 'force not compensated: dynamics of the sensor are not known';
    this.drawLines();
  }
  onShow() { this.draw(); this.drawLines(); }
}
