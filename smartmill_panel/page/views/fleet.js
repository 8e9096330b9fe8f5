// The machines of a fleet: records, common estimates, outliers, age of the last push.
import { age, digits, fixed, make, table, withDeviation } from '../format.js';

const TOPIC = 'loadmeter/fleet';
const ODD = 0.5;        // [1] probability above which a machine counts as an outlier
const LEAST_REACH = 0.1;  // [1] of ln Ktc: smallest half-width of the interval axis
const REDRAW = 1000;      // [ms] between two updates of the ages
const NONE = 'This machine belongs to no fleet: the parameter fleet of loadmeter_node is empty.';

const percent = share => `${fixed(100 * share, share > 0.1 && share < 0.9 ? 0 : 1)} %`;
const word = (kind, text) => make('span', { class: `word ${kind}` }, text);
const dim = text => make('span', { class: 'dim' }, text);
const scrolled = element => make('div', { class: 'scroll' }, element);

// Interval of effect ± two standard deviations, zero in the middle.
function interval(effect, deviation, reach) {
  const at = value => `${50 + 50 * Math.max(-1, Math.min(1, value / reach))}%`;
  const [low, high] = [at(effect - 2 * deviation), at(effect + 2 * deviation)];
  return make('div', { class: 'interval', title: `${fixed(100 * effect, 2)} % ± ${fixed(100 * deviation, 2)} %` },
    make('i', { style: `left: ${low}; right: calc(100% - ${high})` }), make('b', { style: `left: ${at(effect)}` }));
}

export class Fleet {
  // Cards: server, machines, estimates by tool and material, records by machine.
  constructor(view, link, card) {
    Object.assign(this, { link, drawn_at: 0 });
    this.places = {};
    for (const [name, title, extra] of [['server', 'Fleet', 'wide'], ['machines', 'Machines', 'wide'], ['pairs', 'Estimates of the fleet', ''], ['knows', 'Records by machine', '']]) {
      const element = card(title, `tools-free ${extra}`);
      view.append(element);
      this.places[name] = make('div', { id: `fleet-${name}` });
      element.append(this.places[name]);
      element.hidden = name !== 'server';
    }
    this.places.server.append(dim(NONE));
    link.on(TOPIC, message => { this.message = message; this.news = true; });
  }

  refresh() {
    if (!this.message || (!this.news && performance.now() - this.drawn_at < REDRAW)) return;
    this.drawn_at = performance.now();
    this.news = false;
    for (const [name, place] of Object.entries(this.places)) place.parentElement.hidden = name !== 'server' && !this.message.machines.length;
    this.showServer(this.message);
    this.showMachines(this.message);
    this.showPairs(this.message);
    this.showKnows(this.message);
  }

  showServer(m) {
    const waiting = m.behind ? word('warn', `${m.behind} of this machine's records are not sent yet`) : word('good', 'all records of this machine are sent');
    const odd = m.machines.filter(machine => machine.odd > ODD);
    const parts = ['machines', 'batches', 'tools', 'cuts'].map(name => Number.isFinite(m[`between_${name}`]) ? `${digits(100 * m[`between_${name}`], 2)} % between ${name}` : null).filter(Boolean);
    this.places.server.replaceChildren(
      make('p', { class: 'sentence' }, m.reached ? word('good', `The server answers: ${m.message}`) : word('bad', `The last push failed: ${m.message}`)),
      make('p', { class: 'row' }, waiting, odd.length ? word('warn', `outliers: ${odd.map(machine => machine.name).join(', ')}`) : m.machines.length ? word('good', 'no outlier') : null,
        dim(`updated ${age(this.link.age(TOPIC))} ago${m.reached || !m.machines.length ? '' : '; the values below are older'}`)),
      parts.length ? make('p', { class: 'dim' }, `Ktc scatters by ${parts.join(', ')}.`) : '');
  }

  showMachines(m) {
    const passed = Math.max(0, this.link.age(TOPIC));
    const reach = Math.max(LEAST_REACH, ...m.machines.map(one => Math.abs(one.effect) + 2 * one.effect_std).filter(Number.isFinite));
    const rows = [...m.machines].sort((a, b) => (b.odd > ODD) - (a.odd > ODD) || a.name.localeCompare(b.name, undefined, { numeric: true })).map(one => {
      const known = Number.isFinite(one.effect);
      const push = !one.member ? dim('no login') : Number.isFinite(one.silent) ? `${age(one.silent + passed)} ago` : word('warn', 'never');
      return [make('span', {}, make('b', {}, one.name), one.here ? dim(' this one') : ''), push,
        !one.member || !Number.isFinite(one.silent) ? dim('–') : one.behind ? word('warn', `${one.behind}`) : word('good', '0'),
        one.member ? `${one.records}` : dim('–'), known ? `${withDeviation(100 * one.effect, 100 * one.effect_std)} %` : dim('–'),
        known ? interval(one.effect, one.effect_std, reach) : '',
        !known ? dim('–') : one.odd > ODD ? word('bad', `outlier, ${percent(one.odd)}${one.meaning ? `: ${one.meaning}` : ''}`) : dim(percent(one.odd))];
    });
    this.places.machines.replaceChildren(scrolled(table(
      ['Machine', 'Last push', 'Not sent then', 'Records', 'Ktc relative to the fleet', `± ${fixed(100 * reach)} %`, 'Outlier probability'], rows)));
  }

  showPairs(m) {
    this.places.pairs.replaceChildren(m.pairs.length ? scrolled(table(['Tool', 'Material', 'Records', 'Next cut here, Ktc [N/mm²]', ''], m.pairs.map(pair => [
      pair.tool, pair.material, `${pair.records}`, withDeviation(1e-6 * pair.ktc, 1e-6 * pair.ktc_std), pair.own ? dim(`${pair.own} own`) : word('plain', 'no own records')]))) : dim('No record yet'));
  }

  showKnows(m) {
    const most = Math.max(1, ...m.machines.flatMap(machine => [...machine.knows]));
    const cell = count => make('span', { class: 'count', style: `--share: ${count ? 0.25 + 0.75 * Math.log1p(count) / Math.log1p(most) : 0}` }, count ? `${count}` : '·');
    this.places.knows.replaceChildren(m.pairs.length ? scrolled(table(['Records', ...m.pairs.map(pair => make('span', {}, pair.tool, make('br'), pair.material))],
      m.machines.map(machine => [machine.name, ...Array.from(machine.knows, cell)]))) : dim('No record yet'));
  }
}
