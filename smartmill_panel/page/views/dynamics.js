// Measured FRFs, fitted modes, and the hits of the measurement.
import { clock, deg, digits, fixed, make, table, withDeviation } from '../format.js';
import { Plot, colour } from '../plot.js';

const POINTS = { tool_tip: 'tool', force_sensor: 'force sensor' };

const nameOf = m => `${POINTS[m.point] ?? m.point} ${m.direction}`;

// direct + sum over modes of gain w0^2 / (w0^2 - w^2 + 2 i z w0 w)
function response(model, f) {
  let re = model.direct, im = 0;
  for (const m of model.modes) {
    const a = m.frequency ** 2 - f ** 2, b = 2 * m.damping_ratio * m.frequency * f, n = a * a + b * b;
    re += m.gain * m.frequency ** 2 * a / n;
    im -= m.gain * m.frequency ** 2 * b / n;
  }
  return [re, im];
}

const PARTS = {
  magnitude: { name: 'magnitude', of: (re, im) => Math.hypot(re, im), log: true },
  phase: { name: 'phase', of: (re, im) => deg(Math.atan2(im, re)), label: 'Phase [°]', plain: true },
  real: { name: 'real', of: re => re },
  imag: { name: 'imaginary', of: (re, im) => im },
};

export class Dynamics {
  constructor(parent, link, card, store) {
    Object.assign(this, { frfs: {}, models: {}, picked: null, store });
    const big = card('Frequency response'), small = card('Coherence'), side = card('Modes', 'side tools-free');
    this.hits = new Hits(link);
    parent.append(big, side, small);
    this.big = big;
    this.measured = make('span', { class: 'choice row' });
    this.parts = make('span', { class: 'choice row' }, ...Object.entries(PARTS).map(([key, p]) => make('button', { 'data-part': key, onclick: () => { store.part = key; this.draw(); } }, p.name)));
    this.hit_list = make('div', { class: 'hits', id: 'hits' });
    big.append(make('div', { class: 'choices' }, this.measured, this.parts));
    this.plot = new Plot(big, { name: 'frf', group: 'frf', x: { label: 'Frequency [Hz]', low: 0 }, y: { label: '' }, empty: 'No FRF measured yet', read: (x, y) => [`${fixed(x, 1)} Hz`, digits(y)] });
    this.coherence = new Plot(small, { name: 'coherence', group: 'frf', x: { label: 'Frequency [Hz]', low: 0 }, y: { label: 'Coherence', low: 0, high: 1 }, empty: 'Coherence requires two hits', read: (x, y) => [`${fixed(x, 1)} Hz`, fixed(y, 3)] });
    this.list = make('div', { class: 'dim' }, 'No modes yet');
    side.append(this.list, this.hit_list);
    const key = nameOf;
    link.on('tool/frf', m => { this.frfs[key(m)] = m; this.picked ??= key(m); this.news = true; });
    link.on('tool/modes', m => { this.models[key(m)] = m; this.news = true; });
  }

  draw() {
    const frf = this.frfs[this.picked], model = this.models[this.picked], part = PARTS[this.store.part] ?? PARTS.magnitude;
    const names = Object.keys(this.frfs).sort();
    this.measured.replaceChildren(...names.map(name => make('button', { 'aria-pressed': String(name === this.picked), onclick: () => { this.picked = name; this.draw(); } }, name)));
    for (const b of this.parts.children) b.setAttribute('aria-pressed', String(PARTS[b.dataset.part] === part));
    this.drawModes();
    this.drawHits();
    if (!frf) return;
    const scale = frf.unit === 'm/N' ? 1e6 : 1, unit = frf.unit === 'm/N' ? 'µm/N' : '1';
    const x = frf.frequency, of = (re, im) => part.plain ? part.of(re, im) : scale * part.of(re, im);
    const series = [{ x, y: Array.from(x, (_, k) => of(frf.real[k], frf.imag[k])), color: colour('measured'), width: 1.4, label: `measured, ${frf.averages} hits` }];
    if (model) series.push({ x, y: Array.from(x, f => of(...response(model, f))), color: colour('x'), width: 2, label: `fitted, ${fixed(100 * model.relative_error, 1)} % error` });
    Object.assign(this.plot.options.y, { label: part.label ?? `${part.name} [${unit}]`, log: !!part.log });
    this.plot.set({ series, marks: (model?.modes ?? []).map(m => ({ x: m.frequency, label: `${fixed(m.frequency)} Hz`, color: colour('x') })) });
    this.coherence.set({ series: frf.averages > 1 ? [{ x, y: frf.coherence, color: colour('z'), width: 1.3 }] : [] });
    this.big.aside.textContent = frf.tool;
  }

  drawModes() {
    const names = Object.keys(this.models).sort();
    if (!names.length) return;
    this.list.className = '';
    this.list.replaceChildren(...names.flatMap(name => {
      const model = this.models[name], tool = model.unit === 'm/N';
      return [make('h3', { class: 'dim', style: 'font-size: 15px; margin: 10px 0 2px' }, name),
        table(['Frequency [Hz]', 'Damping [%]', tool ? 'Stiffness [N/µm]' : 'Gain'], model.modes.map(m => [withDeviation(m.frequency, m.frequency_std),
          withDeviation(100 * m.damping_ratio, 100 * m.damping_ratio_std),
          tool ? withDeviation(1e-6 / m.gain, 1e-6 * m.gain_std / m.gain ** 2) : withDeviation(m.gain, m.gain_std)]))];
    }));
  }
  drawHits() {
    const found = this.hits.of(this.picked);
    if (!found) return this.hit_list.replaceChildren();
    const accepted = found.hits.filter(b => b.accepted).length;
    this.hit_list.replaceChildren(make('div', { class: 'dim' }, `Hits ${found.name}: ${accepted} accepted` + (accepted < found.hits.length ? `, ${found.hits.length - accepted} rejected` : '')),
      ...found.hits.map((b, k) => b.accepted ? make('i', { title: `hit ${k + 1} at ${clock(b.time)}: accepted` }) :
        make('span', { class: 'word bad', title: clock(b.time) }, `hit ${k + 1} rejected: ${b.why}`)),
      found.stage ? make('div', { class: 'dim' }, found.stage) : '');
  }
  refresh() {
    if (this.news) { this.news = false; this.draw(); }
    if (this.hits.news) { this.hits.news = false; this.drawHits(); }
  }
  onShow() { this.draw(); }
}

// Hits from the feedback of the measurement: "hit 3 of 5", "hit thrown away: reason".
class Hits {
  constructor(link) {
    this.goals = new Map();
    for (const action of ['hammer/measure_frf', 'kalman/measure_frf']) {
      link.on(`${action}/goal`, m => { Object.assign(this.goal(m.goal_id), { name: nameOf(m.goal) }); this.news = true; });
      link.on(`${action}/feedback`, m => this.addFeedback(m));
      link.on(`${action}/result`, m => {
        const goal = this.goal(m.status.goal_id);
        Object.assign(goal, { stage: m.result.code ? m.result.message : '', ended: true });
        this.fill(goal, m.result.frf.averages, m.header.stamp);
        this.news = true;
      });
    }
  }
  goal(id) {
    if (!this.goals.has(id.id)) this.goals.set(id.id, { hits: [], stage: '', name: '', time: id.stamp });
    return this.goals.get(id.id);
  }
  // Latched messages may arrive in any order.
  addFeedback(m) {
    const goal = this.goal(m.status.goal_id), text = m.feedback.stage, why = text.match(/^hit thrown away: (.*)/)?.[1], time = m.header.stamp;
    if (!goal.ended && !(goal.heard > time)) Object.assign(goal, { stage: text, heard: time });
    if ((why || /^hit \d+ of/.test(text)) && !goal.hits.some(b => b.time === time)) {
      goal.hits.push({ accepted: !why, why, time });
      goal.hits.sort((a, b) => a.time - b.time);
    }
    if (time >= goal.heard) this.fill(goal, m.feedback.hits_done, time);
    this.news = true;
  }
  // Feedback may skip messages: hits missing in it were accepted.
  fill(goal, accepted, time) {
    for (let missing = accepted - goal.hits.filter(b => b.accepted).length; missing > 0; --missing) goal.hits.push({ accepted: true, time });
  }
  // The running measurement, else the newest one at a point.
  of(name) {
    const all = [...this.goals.values()].filter(g => g.hits.length || (g.stage && !g.ended)).sort((a, b) => b.time - a.time);
    return all.find(g => !g.ended) ?? all.find(g => g.name === name) ?? null;
  }
}
