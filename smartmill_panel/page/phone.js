// Speeds against chatter from sound alone, for a phone: no data of the cut but teeth and speed.
import { Link } from './link.js';
import { age, clock, digits, fixed, make, radPerSec, rpm } from './format.js';

const REFRESH = 100;         // [ms]
const STALE_AGE = 2;         // [s] of a message that is published five times a second
const MOST_CLIPPED = 0.001;  // [1]
const STATES = [['bad', 'No sound'], ['good', 'Listening'], ['warn', 'Cutting']];
const VERDICTS = [['none', 'No cut'], ['stable', 'Stable'], ['chatter', 'CHATTER'], ['unsure', 'Not certain']];
const QUIETEST = -80;        // [dB] of the bar, relative to its full length
const PASCAL = 20e-6;        // [Pa] 0 dB

const percent = share => `${fixed(100 * share)} %`;

// Level in words, and as a share of the bar.
function levelOf(message) {
  const { level, unit } = message;
  if (!(level > 0)) return ['–', 0];
  if (unit === 'Pa') return [`${fixed(20 * Math.log10(level / PASCAL))} dB`, 20 * Math.log10(level / PASCAL) / 120];
  const decibel = 20 * Math.log10(level);
  return [unit === '1' ? `${fixed(decibel)} dB of full scale` : `${digits(level)} ${unit}`, 1 - decibel / QUIETEST];
}

class Phone {
  constructor(config) {
    const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
    this.link = new Link(`${scheme}://${location.host}/`, config.namespace);
    this.link.on('sound/advice', message => { this.message = message; });
    document.documentElement.dataset.theme = matchMedia('(prefers-color-scheme: light)').matches ? 'light' : 'dark';
    this.build(config.name);
    setInterval(() => this.refresh(), REFRESH);
  }

  build(name) {
    const card = (title, extra, ...children) => {
      const element = make('section', { class: `card ${extra}` }, title ? make('h2', {}, title) : null, ...children);
      document.querySelector('main').append(element);
      return element;
    };
    this.state = make('span', { id: 'state', role: 'status' });
    this.level = make('span', { class: 'dim', id: 'level' });
    this.bar = make('div', { class: 'bar' }, make('i'));
    this.clipping = make('div', { id: 'clipping' });
    card('', '', make('div', { class: 'listening' }, this.state, make('b', {}, name)), this.bar, make('div', { class: 'line' }, this.level, this.clipping));

    this.shape = make('span', { class: 'shape none' });
    this.word = make('div', { class: 'value', id: 'verdict' });
    this.frequency = make('div', { id: 'frequency' });
    this.verdict = card('', '', make('div', { class: 'verdict', role: 'status' }, this.shape, make('div', {}, this.word, this.frequency)));

    this.next = make('div', { class: 'value', id: 'next' });
    this.stable = make('div', { id: 'stable' });
    this.go = make('button', { class: 'main', id: 'go', onclick: () => this.newCut(this.proposed) });
    this.others = make('div', { class: 'others', id: 'others' });
    this.advice = card('Next speed', 'next', this.next, this.stable, this.go, this.others);

    const number = (id, label, step) => [make('label', {}, label, make('input', { id, type: 'number', inputmode: 'numeric', min: '0', step }))];
    this.answer = make('div', { id: 'answer', class: 'dim' });
    this.settings = card('', '', make('div', { class: 'fields' }, ...number('teeth', 'Teeth', '1'), ...number('speed', 'Next cut [rpm]', '10'),
      make('button', { id: 'set', onclick: () => this.set() }, 'Set')), this.answer);

    this.tries = make('div', { id: 'tries' });
    this.discard = make('button', { id: 'discard', onclick: () => this.send({ discard_last: true }) }, 'The last was no cut');
    card('Tries', '', this.tries, make('div', { class: 'row' },
      make('button', { id: 'restart', onclick: () => this.send({ restart: true }) }, 'New tool, depth or material'), this.discard));

    this.text = make('p', { class: 'dim last', id: 'text' });
    card('', '', make('details', {}, make('summary', {}, 'Range of the spindle, last event'),
      make('div', { class: 'fields' }, ...number('low', 'Lowest [rpm]', '10'), ...number('high', 'Highest [rpm]', '10'),
        make('button', { id: 'range', onclick: () => this.setRange() }, 'Set')), this.text));
    this.input = id => document.querySelector(`#${id}`);
  }

  // [rpm] entered; empty: NaN
  entered(id) { return this.input(id).value === '' ? NaN : +this.input(id).value; }

  set() {
    const teeth = this.entered('teeth'), speed = this.entered('speed');
    this.send({ ...(Number.isFinite(teeth) && { teeth }), spindle_speed: Number.isFinite(speed) ? radPerSec(speed) : 0 });
  }

  setRange() {
    const low = this.entered('low'), high = this.entered('high');
    this.send({ speed_low: radPerSec(low || 0), speed_high: radPerSec(high || 0) });
  }

  newCut(speed) {
    this.input('speed').value = fixed(rpm(speed));
    this.send({ spindle_speed: speed });
  }

  async send(setting) {
    const answer = await fetch('api/sound', { method: 'POST', body: JSON.stringify(setting) }).catch(() => null);
    const answered = await answer?.json().catch(() => null);
    this.answer.textContent = answered?.message ?? 'The panel does not answer.';
    this.answer.className = answer?.ok ? 'dim' : 'bad';
  }

  refresh() {
    const { link, message: m } = this;
    const old = link.age('sound/advice'), stale = !link.alive || old > STALE_AGE;
    document.body.classList.toggle('gone', stale);
    const [kind, word] = !link.alive ? ['bad', 'Panel does not answer'] : !m ? ['warn', 'No microphone yet']
      : stale ? ['bad', `No report for ${age(old)}`] : STATES[m.state];
    const text = JSON.stringify([kind, word, stale, m?.header]);
    if (text === this.drawn) return;
    this.drawn = text;
    this.state.className = `word ${kind}`;
    this.state.textContent = word;
    for (const element of [this.verdict, this.advice, this.tries]) element.classList.toggle('stale', stale);
    if (m) this.show(m, stale);
  }

  show(m, stale) {
    const [level, share] = levelOf(m), clipped = m.clipped > MOST_CLIPPED;
    this.level.textContent = level;
    this.bar.firstChild.style.width = `${100 * Math.max(0, Math.min(1, stale ? 0 : share))}%`;
    this.bar.className = `bar ${clipped ? 'bad' : ''}`;
    this.clipping.textContent = clipped ? `Clipping, ${digits(100 * m.clipped, 2)} %: reduce the gain` : '';
    this.clipping.className = clipped ? 'word bad' : '';
    this.showVerdict(m);
    this.showNext(m);
    this.showTries(m);
    this.text.textContent = m.text;
    for (const [id, value] of [['teeth', m.teeth], ['speed', rpm(m.spindle_speed)], ['low', rpm(m.speed_low)], ['high', rpm(m.speed_high)]]) this.fill(id, value);
  }

  // The value of the node, unless the operator is entering another one.
  fill(id, value) {
    const input = this.input(id), now = value > 0 ? fixed(value) : '';
    if (now === input.dataset.node) return;
    input.dataset.node = now;
    if (document.activeElement !== input) input.value = now;
  }

  showVerdict(m) {
    const last = m.tries.at(-1), [kind, word] = last ? VERDICTS[last.kind] : ['none', m.teeth ? 'No cut yet' : 'Set the teeth'];
    this.shape.className = `shape ${kind}`;
    this.verdict.className = `card ${kind}`;
    this.word.textContent = word;
    const parts = [];
    if (last?.kind === 2) parts.push(`${fixed(last.frequency)} Hz`);
    if (last && Number.isFinite(last.spindle_speed)) parts.push(`at ${fixed(rpm(last.spindle_speed))} rpm`);
    if (last && Number.isFinite(last.probability)) parts.push(`probability of chatter ${percent(last.probability)}`);
    this.frequency.replaceChildren(...parts.map(part => make('div', {}, part)));
  }

  showNext(m) {
    const [best, ...others] = m.next_speed, last = m.tries.at(-1);
    this.proposed = best;
    const words = best ? [fixed(rpm(best)), make('small', {}, ' rpm')] : [make('small', { class: 'dim' },
      last?.kind === 1 ? 'None needed: the cut is stable' : last ? 'Cut again' : m.teeth ? 'Start the spindle, then cut' : 'Enter the number of teeth')];
    this.next.replaceChildren(...words);
    this.stable.textContent = best ? `stable with a probability of ${percent(m.next_stable[0])}` : '';
    this.go.hidden = !best;
    this.go.textContent = best ? `New cut at ${fixed(rpm(best))} rpm` : '';
    this.others.replaceChildren(...others.map((speed, k) => make('button', { onclick: () => this.newCut(speed) }, `${fixed(rpm(speed))} rpm, ${percent(m.next_stable[k + 1])}`)));
  }

  showTries(m) {
    this.discard.hidden = !m.tries.length;
    if (!m.tries.length) return this.tries.replaceChildren(make('p', { class: 'dim' }, 'None yet'));
    const rows = m.tries.map((one, k) => {
      const [kind, word] = VERDICTS[one.kind];
      return make('tr', { class: one.used ? '' : 'unused', title: one.text }, make('td', { title: clock(one.begin) }, `${k + 1}`), make('td', { class: 'number' }, fixed(rpm(one.spindle_speed))),
        make('td', {}, make('span', { class: `shape ${kind}` }), word === 'CHATTER' ? 'Chatter' : word), make('td', { class: 'number' }, one.kind === 2 ? fixed(one.frequency) : ''));
    });
    this.tries.replaceChildren(make('table', {}, make('thead', {}, make('tr', {}, make('th'), make('th', { class: 'number' }, 'rpm'), make('th'), make('th', { class: 'number' }, 'Hz'))),
      make('tbody', {}, ...rows.reverse())));
  }
}

const answer = await fetch('api/config');
window.smartmill = new Phone(await answer.json());
