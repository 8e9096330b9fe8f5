// Stability chart with the running cut.
import { digits, fixed, make, rpm, table } from '../format.js';
import { Plot, colour } from '../plot.js';

const MM = 1e3;

// Cumulative standard normal distribution (Abramowitz and Stegun 26.2.17, error 7.5e-8).
function normal(z) {
  const t = 1 / (1 + 0.2316419 * Math.abs(z));
  const tail = Math.exp(-z * z / 2) / Math.sqrt(2 * Math.PI) *
    t * (0.319381530 + t * (-0.356563782 + t * (1.781477937 + t * (-1.821255978 + t * 1.330274429))));
  return z > 0 ? 1 - tail : tail;
}

export const toMm = list => Array.from(list, v => v === null ? Infinity : MM * v);
export const toRpm = list => Array.from(list, rpm);

// ys interpolated linearly at x; xs ascending.
function at(xs, ys, x) {
  let i = xs.findIndex(v => v >= x);
  if (i < 0) return NaN;
  if (i === 0) return ys[0];
  const share = (x - xs[i - 1]) / (xs[i] - xs[i - 1]);
  return ys[i - 1] + share * (ys[i] - ys[i - 1]);
}

export class ChartView {
  constructor(card, link, name) {
    Object.assign(this, { card, link, what_if: null, spread: null });
    this.plot = new Plot(card, {
      name: `stability_${name}`, x: { label: 'Spindle speed [rpm]' }, y: { label: 'Axial depth [mm]', low: 0 },
      empty: 'No chart yet: it requires the tool\'s FRFs and the cutting coefficients', read: (x, y) => this.read(x, y),
    });
    link.on('stability/chart', chart => { this.setChart(chart); });
    for (const topic of ['cut/condition', 'cnc/state', 'chatter/state']) link.on(topic, () => {});
  }

  setChart(chart) {
    this.chart = {
      speed: toRpm(chart.spindle_speed), limit: toMm(chart.depth_limit), frequency: chart.chatter_frequency,
      torque: toMm(chart.torque_depth_limit), power: toMm(chart.power_depth_limit),
    };
    this.message = chart;
    this.card.aside.textContent = `${chart.tool} in ${chart.material}, stable at any speed below ${digits(MM * chart.absolute_depth_limit)} mm`;
    const best = chart.recommended[0];
    this.rate = best ? best.material_removal_rate / (best.axial_depth * best.spindle_speed) : NaN;
    this.fetchSpread();
    this.draw();
  }

  // Distribution of the limit from the standard deviations of the measurement.
  async fetchSpread() {
    const answer = await fetch('api/what_if?spread=1').catch(() => null);
    const found = await answer?.json().catch(() => null);
    if (!found?.limit_low) return;
    this.spread = { speed: toRpm(found.spindle_speed), low: toMm(found.limit_low), high: toMm(found.limit_high), limit: toMm(found.depth_limit) };
    this.draw();
  }

  setWhatIf(what_if) { this.what_if = what_if; this.draw(); }

  live() {
    const condition = this.link.message('cut/condition'), state = this.link.message('cnc/state');
    if (!condition || condition.kind !== 2 || !state) return null;
    return { x: rpm(state.spindle_speed > 1 ? state.spindle_speed : condition.spindle_speed), y: MM * condition.axial_depth };
  }

  // Upper end of the depth axis: the recommended and running cuts, not the deepest pockets.
  highest() {
    const useful = this.message.recommended.map(p => MM * p.axial_depth);
    const depths = [...useful, ...this.message.unstable.map(p => MM * p.axial_depth), this.live()?.y ?? 0];
    const limits = this.chart.limit.filter(Number.isFinite).sort((a, b) => a - b);
    return 1.3 * Math.max(...depths, limits[Math.floor(0.5 * limits.length)] ?? 1);
  }

  draw() {
    if (!this.chart) return;
    const { chart, message } = this, top = this.highest();
    this.plot.options.y.high = top;
    const capped = list => list.map(v => Math.min(v, 4 * top));
    const series = [{ kind: 'band', x: chart.speed, y: chart.speed.map(() => 0), y2: capped(chart.limit), color: colour('good'), alpha: 0.1 }];
    if (this.spread && !this.what_if)
      series.push({ kind: 'band', x: this.spread.speed, y: capped(this.spread.low), y2: capped(this.spread.high), color: colour('x'), alpha: 0.25, label: '10 to 90 % probable' });
    series.push(
      { x: chart.speed, y: capped(chart.limit), color: colour('x'), width: 2, label: 'chatter limit', alpha: this.what_if ? 0.45 : 1 },
      { x: chart.speed, y: capped(chart.torque), color: colour('dim'), dash: [7, 4], label: 'torque' },
      { x: chart.speed, y: capped(chart.power), color: colour('dim'), dash: [2, 4], label: 'power' });
    if (this.what_if) series.push(...this.whatIfSeries(top));
    const live = this.live();
    const points = message.recommended.map((p, k) => ({ x: rpm(p.spindle_speed), y: MM * p.axial_depth, color: colour('good'), radius: 5,
      label: k === 0 && !live ? `${fixed(rpm(p.spindle_speed))} rpm, ${fixed(MM * p.axial_depth, 2)} mm` : '' }));
    points.push(...message.unstable.map(p => ({ x: rpm(p.spindle_speed), y: MM * p.axial_depth, color: colour('bad'), radius: 4, hollow: true })));
    if (live) {
      const chatter = this.link.message('chatter/state')?.chatter;
      points.push({ ...live, color: colour(chatter ? 'bad' : 'warn'), radius: 10, label: chatter ? 'now: chatter' : 'now' });
    }
    this.plot.set({ series, points, marks: live ? [{ x: live.x, color: colour('warn') }, { y: live.y, color: colour('warn') }] : [] });
  }

  // Limit of the modified cut; at the foot the mode that limits each speed.
  whatIfSeries(top) {
    const found = this.what_if, series = [], colours = ['x', 'y', 'z', 'warn', 'good', 'bad'];
    series.push({ x: found.speed, y: found.limit.map(v => Math.min(v, 4 * top)), color: colour('warn'), width: 2.5, label: 'what if' });
    const named = new Set();
    for (let i = 0; i < found.speed.length;) {
      let end = i;
      while (end + 1 < found.speed.length && found.mode[end + 1] === found.mode[i]) ++end;
      const mode = found.mode[i], xs = found.speed.slice(i, Math.min(end + 2, found.speed.length));
      if (mode >= 0)
        series.push({ kind: 'band', free: true, x: xs, y: xs.map(() => 0), y2: xs.map(() => 0.025 * top), color: colour(colours[mode % 6]), alpha: 1,
          label: named.has(mode) ? undefined : `limited by ${found.modes[mode]}` });
      named.add(mode);
      i = end + 1;
    }
    return series;
  }

  read(x, y) {
    if (!this.chart) return [];
    const { chart, spread } = this, limit = at(chart.speed, chart.limit, x);
    const lines = [`${fixed(x)} rpm, ${fixed(y, 2)} mm: ${y < limit ? 'stable' : 'chatter'}`, `limit ${digits(limit)} mm, chatter at ${fixed(at(chart.speed, chart.frequency, x))} Hz`];
    if (Number.isFinite(this.rate)) lines.push(`${fixed(this.rate * 1e-3 * y * x * 2 * Math.PI / 60 * 60e6, 1)} cm³/min`);
    if (spread) {
      const deviation = Math.log(at(spread.speed, spread.high, x) / at(spread.speed, spread.low, x)) / 2.563;
      lines.push(`probability of chatter ${fixed(100 * normal(Math.log(y / at(spread.speed, spread.limit, x)) / Math.max(deviation, 1e-6)))} %`);
    }
    if (y > at(chart.speed, chart.torque, x)) lines.push('beyond the spindle\'s torque');
    if (y > at(chart.speed, chart.power, x)) lines.push('beyond the spindle\'s power');
    if (this.what_if) {
      const mode = this.what_if.mode[this.what_if.speed.findIndex(v => v >= x)];
      lines.push(`what if: limit ${digits(at(this.what_if.speed, this.what_if.limit, x))} mm` + (mode >= 0 ? `, limited by ${this.what_if.modes[mode]}` : ''));
    }
    return lines;
  }

  refresh() {
    const live = JSON.stringify([this.live(), this.link.message('chatter/state')?.chatter]);
    if (live !== this.drawn) { this.drawn = live; this.draw(); }
  }
  onShow() { this.draw(); }
}

export class PointsTable {
  constructor(card, link) {
    this.place = make('div', { class: 'dim' }, 'No chart yet');
    card.append(this.place);
    link.on('stability/chart', chart => {
      const rows = chart.recommended.map(p => [fixed(rpm(p.spindle_speed)), fixed(MM * p.axial_depth, 3), digits(MM * p.depth_limit), fixed(p.chatter_frequency),
        fixed(p.torque, 2), fixed(1e-3 * p.power, 2), fixed(60e6 * p.material_removal_rate, 1)]);
      this.place.replaceChildren(table(['Speed [rpm]', 'Depth [mm]', 'Limit [mm]', 'Chatter frequency [Hz]', 'Torque [N m]', 'Power [kW]', 'Removal rate [cm³/min]'], rows, { id: 'points' }));
      this.place.className = '';
    });
  }
}
