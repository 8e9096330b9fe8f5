// The shop's machines: what each knows, what they know together, who is odd, how far behind each push is.
import { age, digits, fixed, make, table, withDeviation } from '../format.js';

const TOPIC = 'loadmeter/fleet';
const ODD = 0.5;        // probability from which a machine is called odd
const LEAST_REACH = 0.1;  // [1] of ln Ktc, half of the intervals' width at least
const TELL = 1000;      // [ms] between two looks at the ages
const NONE = 'This machine belongs to no fleet: loadmeter_node has no address of a server (parameter fleet).';

const percent = share => `${fixed(100 * share, share > 0.1 && share < 0.9 ? 0 : 1)} %`;
const word = (kind, text) => make('span', { class: `word ${kind}` }, text);
const dim = text => make('span', { class: 'dim' }, text);
const scrolled = element => make('div', { class: 'scroll' }, element);

// An effect with twice its deviation to both sides, zero in the middle.
function interval(effect, deviation, reach) {
  const at = value => `${50 + 50 * Math.max(-1, Math.min(1, value / reach))}%`;
  const [low, high] = [at(effect - 2 * deviation), at(effect + 2 * deviation)];
  return make('div', { class: 'interval', title: `${fixed(100 * effect, 2)} % ± ${fixed(100 * deviation, 2)} %` },
    make('i', { style: `left: ${low}; right: calc(100% - ${high})` }), make('b', { style: `left: ${at(effect)}` }));
}

export class Fleet {
  // The cards of a view: server, machines, what is known of each tool and material, by whom.
  constructor(view, link, card) {
    Object.assign(this, { link, told: 0 });
    this.places = {};
    for (const [name, title, extra] of [['server', 'Fleet', 'wide'], ['machines', 'Machines', 'wide'], ['pairs', 'What the fleet knows', ''], ['knows', 'Who knows it', '']]) {
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
    if (!this.message || (!this.news && performance.now() - this.told < TELL)) return;
    this.told = performance.now();
    this.news = false;
    for (const [name, place] of Object.entries(this.places)) place.parentElement.hidden = name !== 'server' && !this.message.machines.length;
    this.showServer(this.message);
    this.showMachines(this.message);
    this.showPairs(this.message);
    this.showKnows(this.message);
  }

  showServer(m) {
    const waiting = m.behind ? word('warn', `${m.behind} of this machine's records wait here`) : word('good', 'nothing of this machine waits');
    const odd = m.machines.filter(machine => machine.odd > ODD);
    const parts = ['machines', 'batches', 'tools', 'cuts'].map(name => Number.isFinite(m[`between_${name}`]) ? `${digits(100 * m[`between_${name}`], 2)} % between ${name}` : null).filter(Boolean);
    this.places.server.replaceChildren(
      make('p', { class: 'sentence' }, m.reached ? word('good', `The server answers: ${m.message}`) : word('bad', `The server did not take the last push: ${m.message}`)),
      make('p', { class: 'row' }, waiting, odd.length ? word('warn', `odd: ${odd.map(machine => machine.name).join(', ')}`) : m.machines.length ? word('good', 'no machine is odd') : null,
        dim(`asked ${age(this.link.age(TOPIC))} ago${m.reached || !m.machines.length ? '' : '; what follows is what was known before'}`)),
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
        !known ? dim('–') : one.odd > ODD ? word('bad', `odd, ${percent(one.odd)}${one.meaning ? `: ${one.meaning}` : ''}`) : dim(percent(one.odd))];
    });
    this.places.machines.replaceChildren(scrolled(table(
      ['Machine', 'Last push', 'Behind then', 'Brought', 'Ktc beside the fleet', `± ${fixed(100 * reach)} %`, 'Odd with probability'], rows)));
  }

  showPairs(m) {
    this.places.pairs.replaceChildren(m.pairs.length ? scrolled(table(['Tool', 'Material', 'Records', 'Next cut here, Ktc [N/mm²]', ''], m.pairs.map(pair => [
      pair.tool, pair.material, `${pair.records}`, withDeviation(1e-6 * pair.ktc, 1e-6 * pair.ktc_std), pair.own ? dim(`${pair.own} own`) : word('plain', 'none of its own')]))) : dim('No record yet'));
  }

  showKnows(m) {
    const most = Math.max(1, ...m.machines.flatMap(machine => [...machine.knows]));
    const cell = count => make('span', { class: 'count', style: `--share: ${count ? 0.25 + 0.75 * Math.log1p(count) / Math.log1p(most) : 0}` }, count ? `${count}` : '·');
    this.places.knows.replaceChildren(m.pairs.length ? scrolled(table(['Records', ...m.pairs.map(pair => make('span', {}, pair.tool, make('br'), pair.material))],
      m.machines.map(machine => [machine.name, ...Array.from(machine.knows, cell)]))) : dim('No record yet'));
  }
}
