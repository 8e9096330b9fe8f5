// Model fit (live gap), last explanation, cutting coefficients, state of the nodes.
import { digits, fixed, make, table, withDeviation } from '../format.js';

const STALE_AGE = 10;        // [s]
const REQUEST_PERIOD = 5000;  // [ms] for a newer report
const LEVELS = ['good', 'warn', 'bad', 'dim'], WORDS = ['OK', 'warning', 'error', 'silent'];

export class Discrepancy {
  constructor(card, link) {
    Object.assign(this, { card, link });
    this.place = make('div', { id: 'gap', class: 'dim' }, 'No live gap: start the monitor (monitor:=true), which compares the cuts with a twin.');
    card.append(this.place);
    link.on('discrepancy/state', message => { if (!this.message || message.header.stamp >= this.message.header.stamp) this.message = message; this.news = true; });
  }
  refresh() {
    const m = this.message;
    if (!m) return;
    const old = !this.link.alive || this.link.age('discrepancy/state') > STALE_AGE;
    this.place.classList.toggle('stale', old);
    if (!this.news) return;
    this.news = false;
    this.place.className = old ? 'stale' : '';
    const rows = m.channels.map((channel, k) => {
      const share = Math.min(1, m.gap[k] / 5), bar = make('div', { class: `bar ${m.gap[k] > 1.5 ? 'bad' : ''}`, style: 'min-width: 160px' }, make('i'));
      bar.firstChild.style.width = `${100 * share}%`;
      return [channel, fixed(m.gap[k], 2), bar];
    });
    this.place.replaceChildren(
      make('p', { class: `sentence ${m.model_fits ? 'good' : 'bad'}` }, rows.length ? (m.model_fits ? 'The model fits.' : 'The model does not fit: it lacks an effect.') : 'Not compared.'),
      make('p', { class: 'dim' }, `${m.condition}: gap between twin and machine relative to the noise; 1 is the noise floor`), table(['Channel', 'Gap', ''], rows));
  }
}

export class Report {
  constructor(card, link) {
    Object.assign(this, { link, last_request: -Infinity });
    this.place = make('div', { id: 'report' });
    card.append(make('h2', { class: 'dim', style: 'font-size: 15px; margin: 18px 0 0' }, 'Last explanation'), this.place);
  }
  async refresh() {
    if (performance.now() - this.last_request < REQUEST_PERIOD || !this.link.alive) return;
    this.last_request = performance.now();
    const answer = await fetch('api/report').catch(() => null);
    const found = await answer?.json().catch(() => null);
    const text = JSON.stringify(found);
    if (!found || text === this.shown_text) return;
    this.shown_text = text;
    if (!found.report) { this.place.replaceChildren(make('p', { class: 'dim' }, found.message)); return; }
    this.show(found.report, found.folder);
  }
  show(report, folder) {
    const effects = (report.effects ?? []).map(e => [e.name, Object.entries(e.parameters ?? {}).map(([key, p]) => `${key} ${Array.isArray(p.value) ? p.value.map(v => digits(v)).join(', ') : withDeviation(p.value, p.std)}`).join('; '),
      Number.isFinite(e.heldout_gap_reduction) ? `${fixed(100 * e.heldout_gap_reduction)} %` : '–', (e.alternatives ?? []).map(a => a.name).join(', ')]);
    const gap = report.gap ?? {}, shares = Object.entries(report.explained_share ?? {});
    this.place.replaceChildren(
      make('p', { class: 'sentence' }, report.sentence ?? report.verdict.replaceAll('_', ' ')),
      make('p', { class: 'dim' }, `${folder}: ${report.verdict.replaceAll('_', ' ')}`),
      table(['Gap', 'Fit', 'Held out'], ['before', 'after'].map(k => [k, fixed(gap[k]?.fit, 2), fixed(gap[k]?.heldout, 2)])),
      effects.length ? table(['Effect', 'Value', 'Reduction of the held-out gap', 'Alternatives'], effects) : '',
      shares.length ? table(['Channel', 'Explained'], shares.map(([c, s]) => [c, `${fixed(100 * s)} %`])) : '',
      report.suggested_test ? make('p', {}, `Suggested test: ${report.suggested_test}`) : '');
  }
}

export class Database {
  constructor(card, link) {
    this.place = make('div', { class: 'dim' }, 'None identified yet');
    card.append(this.place);
    link.on('material/coefficients', m => this.show(m));
    link.on('cut/condition', m => { if (!this.found && m.material) this.fetchStored(m.tool, m.material); });
  }
  // Coefficients of this tool and material from an earlier session.
  async fetchStored(tool, material) {
    const pair = `${tool}/${material}`;
    if (this.last_request === pair) return;
    this.last_request = pair;
    const answer = await fetch(`api/coefficients?${new URLSearchParams({ tool, material })}`).catch(() => null);
    const found = await answer?.json().catch(() => null);
    if (found?.source && !this.found) this.show(found, 'from the database');
  }
  show(m, from = '') {
    this.found = from === '';
    const row = (name, value, deviation, scale, unit) => Number.isFinite(value) ? [name, withDeviation(scale * value, scale * deviation), unit] : null;
    const rows = [row('Ktc', m.ktc, m.ktc_std, 1e-6, 'N/mm²'), row('Krc', m.krc, m.krc_std, 1e-6, 'N/mm²'), row('Kac', m.kac, m.kac_std, 1e-6, 'N/mm²'),
      row('Kte', m.kte, m.kte_std, 1e-3, 'N/mm'), row('Kre', m.kre, m.kre_std, 1e-3, 'N/mm'), row('Kae', m.kae, m.kae_std, 1e-3, 'N/mm')].filter(Boolean);
    this.place.className = '';
    this.place.replaceChildren(make('p', {}, `${m.tool} in ${m.material}`, make('span', { class: 'dim' }, `${from ? ` ${from}` : ''}, from ${m.test_count} cuts by the ${m.source.replaceAll('_', ' ')}`)), table(['Coefficient', 'Value', ''], rows, { id: 'coefficients' }));
  }
}

// The force sensor in use and its calibration.
export class ForceSensor {
  constructor(card, link) {
    this.place = make('div', { class: 'dim' }, 'Unknown');
    card.append(this.place);
    link.on('force/sensor', m => this.show(m));
  }
  show(m) {
    const SENSORS = { table: 'Dynamometer on the table', spindle: 'Six sensors in the spindle', plate: 'Plate under the workpiece' };
    const rows = ['x', 'y', 'z'].filter(k => Number.isFinite(m.constant[k]) || Number.isFinite(m.error[k])).map(k => [
      k, withDeviation(m.constant[k], m.constant_std[k]), Number.isFinite(m.error[k]) ? `${fixed(100 * m.error[k], 2)} %` : '–']);
    this.place.className = '';
    this.place.replaceChildren(
      make('p', { class: `sentence ${m.calibrated ? 'good' : 'bad'}`, id: 'force-sensor' }, `${SENSORS[m.sensor] ?? m.sensor}: ` + (m.calibrated ? 'in use.' : 'not calibrated, no force is published.')),
      make('p', { class: 'dim' }, m.message),
      rows.length ? table(['Axis', 'Constant', m.verified ? 'Error, compared with the reference' : 'Expected error'], rows) : '');
  }
}

export class Diagnostics {
  constructor(card, link) {
    this.found = new Map();
    this.place = make('div', { class: 'dim' }, 'No diagnostics yet');
    card.append(this.place);
    link.on('/diagnostics', m => { for (const s of m.status) this.found.set(s.name, s); this.news = true; });
  }
  refresh() {
    if (!this.news) return;
    this.news = false;
    this.place.className = '';
    this.place.replaceChildren(table(['Node', '', ''], [...this.found.values()].sort((a, b) => a.name.localeCompare(b.name)).map(s => [
      s.name.replace(/^\/?smartmill\//, ''), make('span', { class: LEVELS[s.level] }, WORDS[s.level]), make('span', { class: 'dim' }, s.message)])));
  }
}
