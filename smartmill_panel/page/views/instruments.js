// Instruments: state of each channel and clock from the diagnostics of daq_node; first connection and calibration by setup_node.
import { age, digits, fixed, make, table, withDeviation } from '../format.js';

const STALE_AGE = 3;        // [s] of diagnostics that are published once a second
const REDRAW = 500;         // [ms]
const FULL = 0.9;           // [1] share of the range from which a level is a warning
const PPM = 1e6;
const UNITS = ['V', 'N', 'N m', 'm/s2', 'm/s', 'm', 'A', 'rad', 'Pa', '1'];
const COUPLINGS = ['dc', 'ac', 'iepe'];
const DAY = 86400e3;        // [ms]
const DYNAMOMETER = 'daq/dynamometer';  // whose forces are turned into the machine's frame

const dim = text => make('span', { class: 'dim' }, text);
const word = (kind, text) => make('span', { class: `word ${kind}` }, text);
const KINDS = ['good', 'warn', 'bad', 'bad'];  // by the level of the diagnostics

// Level as a bar of the range with its share.
const bar = (share, faulty) => make('div', { class: `bar ${faulty || share >= 1 ? 'bad' : share > FULL ? 'warn' : ''}`, title: `${fixed(100 * share, 1)} % of the range` },
  make('i', { style: `width: ${Math.min(100, 100 * share)}%` }));

function sensitivityDate(date) {
  const then = Date.parse(date);
  return Number.isFinite(then) ? `${date}, ${Math.max(0, Math.floor((Date.now() - then) / DAY))} days ago` : 'date not stated';
}

export class Instruments {
  constructor(view, link, card) {
    Object.assign(this, { link, drawn_at: 0, found: new Map() });
    this.card = card('Instruments', 'tools-free wide');
    this.place = make('div', { id: 'instruments' }, dim('No instrument yet: roslaunch smartmill_daq daq.launch instrument:=FILE, or the first connection below'));
    this.card.append(this.place);
    view.append(this.card);
    link.on('/diagnostics', (message, stamp) => { for (const status of message.status) this.take(status, stamp); });
  }

  // "NODE: instrument NAME", "NODE: channel TOPIC/NAME"; of other nodes the alignment of streams and the source of the angle.
  take(status, stamp) {
    const [, node, kind, name] = status.name.match(/^\/?(.+?): (instrument|channel|alignment|spindle angle)\s*(.*)$/) ?? [];
    if (!node) return;
    this.found.set(status.name, { node, kind, name, stamp, level: status.level, message: status.message, values: new Map(status.values.map(v => [v.key, v.value])) });
  }

  refresh() {
    if (!this.found.size || performance.now() - this.drawn_at < REDRAW) return;
    this.drawn_at = performance.now();
    const all = [...this.found.values()].sort((a, b) => a.node.localeCompare(b.node));
    const parts = all.filter(one => one.kind === 'instrument').flatMap(one => this.instrument(one, all.filter(other => other.kind === 'channel' && other.node === one.node)));
    const rest = all.filter(one => one.kind === 'alignment' || one.kind === 'spindle angle');
    if (rest.length) parts.push(table(['', ''], rest.map(one => [one.kind === 'alignment' ? `Alignment ${one.name}` : 'Spindle angle', this.state(one)]), { id: 'alignments' }));
    if (parts.length) this.place.replaceChildren(...parts);
  }

  isOld(one) { return !(this.link.now() - one.stamp < STALE_AGE); }
  state(one) {
    if (this.isOld(one)) return make('span', { class: 'word bad stale' }, `no report for ${age(this.link.now() - one.stamp)}`);
    return word(KINDS[one.level] ?? 'bad', one.message);
  }

  instrument(one, channels) {
    const v = key => +(one.values.get(key) ?? NaN);
    const lost = v('samples lost') + v('samples lost by the clock') + v('samples withheld');
    const last = one.values.get('last fault');
    return [
      make('p', { class: 'sentence' }, make('b', {}, `${one.name} `), this.state(one)),
      make('p', { class: 'dim clock' }, `${one.values.get('driver') ?? ''}, ${digits(v('sample rate [Hz]'), 6)} Hz. Clock: drift ${withDeviation(v('clock drift [ppm]'), v('standard deviation of the drift [ppm]'))} ppm, offset ` +
        `${withDeviation(1e3 * v('clock offset [s]'), 1e3 * v('standard deviation of the offset [s]'))} ms, arrivals late by ${digits(1e3 * v('jitter of the arrivals [s]'))} ms, ` +
        `latency ${withDeviation(1e3 * v('latency [s]'), 1e3 * v('standard deviation of the latency [s]'))} ms. ${digits(v('samples in blocks'), 9)} samples, `,
        make('span', { class: lost > 0 ? 'bad' : '' }, `${lost} lost`), last ? `; last fault: ${last}` : ''),
      make('div', { class: 'scroll' }, table(['Channel', 'State', 'Level', 'Mean', 'RMS', 'Clipped', 'Sensitivity', 'Calibration'], channels.map(c => this.channel(c)), { 'data-instrument': one.name }))];
  }

  channel(one) {
    const unit = one.values.get('unit') ?? '', v = key => +(one.values.get(key) ?? NaN);
    const clipped = v('samples clipped');
    return [one.name, this.state(one), bar(v('peak [share of the range]'), one.level > 0), `${digits(v(`mean [${unit}]`), 4)} ${unit}`, `${digits(v(`rms [${unit}]`), 4)} ${unit}`,
      clipped > 0 ? word('bad', `${clipped}`) : '0', `${withDeviation(v(`sensitivity [V/${unit}]`), v('standard deviation of the sensitivity'))} V/${/[ /]/.test(unit) ? `(${unit})` : unit}`,
      dim(sensitivityDate(one.values.get('date of the sensitivity')))];
  }
}

// Name and token for requests that open devices or write files; kept while the page is open.
class Access {
  constructor() {
    this.who = make('input', { type: 'text', placeholder: 'Your name, for the log', maxlength: '40', 'aria-label': 'Name', value: localStorage.getItem('who') ?? '' });
    this.token = make('input', { type: 'password', placeholder: 'Token', autocomplete: 'off', 'aria-label': 'Token' });
  }
  async post(path, body) {
    localStorage.setItem('who', this.who.value);
    const answer = await fetch(`api/${path}`, { method: 'POST', headers: { 'X-SmartMill-Token': this.token.value }, body: JSON.stringify({ ...body, who: this.who.value }) }).catch(() => null);
    return await answer?.json().catch(() => null) ?? { message: 'The panel does not answer.' };
  }
}

const labelled = (text, input) => make('label', {}, text, input);
const select = (words, attributes = {}) => make('select', attributes, ...words.map(w => make('option', {}, w)));
const text = (attributes, value = '') => make('input', { type: 'text', value, ...attributes });
// A word for the file: numbers and true or false as they are, all else quoted.
const yaml = value => /^[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$|^(true|false)$/.test(value) ? value : JSON.stringify(value);

export class FirstConnection {
  // Cards: description and trial of an instrument; calibration of its channels.
  constructor(view, card, config) {
    this.access = new Access();
    const wizard = card('First connection', 'tools-free'), calibration = card('Sensitivity', 'tools-free');
    view.append(wizard, calibration);
    if (!config.commands) {
      const why = 'This panel is read-only. Started with allow_commands and a token file, it opens the devices of new instruments and writes their files. It moves nothing.';
      for (const one of [wizard, calibration]) one.append(make('p', { class: 'dim' }, why));
      return;
    }
    this.buildWizard(wizard);
    this.buildCalibration(calibration);
  }

  buildWizard(card) {
    this.driver = select([], { id: 'instrument-driver' });
    this.options = make('div', { class: 'row fields', id: 'instrument-options' });
    this.name = text({ id: 'instrument-name' }, 'front end');
    this.rate = text({ id: 'instrument-rate', inputmode: 'decimal' }, '51200.0');
    this.count = text({ id: 'instrument-count', inputmode: 'numeric' }, '3');
    this.rows = make('div', { class: 'scroll' });
    this.description = make('textarea', { id: 'instrument-text', rows: 12, spellcheck: 'false', 'aria-label': 'Description' });
    this.file = text({ id: 'instrument-file', placeholder: 'Name of the file' }, 'front_end');
    this.replace = make('input', { type: 'checkbox', id: 'instrument-replace' });
    this.answer = make('p', { id: 'instrument-answer' });
    this.levels = make('div', { class: 'scroll', id: 'instrument-levels' });
    const button = (id, title, action) => make('button', { id, onclick: async () => { this.say('…', ''); await action(); } }, title);
    card.append(
      make('p', { class: 'dim' }, 'Reads the device and writes its file for daq_node; moves nothing.'),
      make('div', { class: 'row' }, this.access.who, this.access.token, button('instrument-begin', '1. Which drivers?', () => this.begin())),
      this.steps = make('div', { hidden: true },
        make('div', { class: 'row fields' }, labelled('Driver', this.driver), labelled('Name', this.name), labelled('Rate [Hz]', this.rate), labelled('Channels', this.count)),
        this.options, this.rows,
        make('p', { class: 'dim' }, 'The file; a change above writes it anew:'), this.description,
        make('div', { class: 'row' }, button('instrument-read', '2. Read one second', () => this.read()), this.file, labelled('replace', this.replace), button('instrument-write', '3. Write the file', () => this.write()))),
      this.answer, this.levels);
    for (const input of [this.driver, this.name, this.rate, this.count]) input.addEventListener('change', () => { this.describe(input); });
  }

  say(line, kind) {
    this.answer.textContent = line;
    this.answer.className = kind;
  }

  async begin() {
    const answer = await this.access.post('instrument', {});
    if (!answer.drivers) { this.say(answer.message, 'bad'); return; }
    this.drivers = answer.drivers;
    this.driver.replaceChildren(...Object.keys(answer.drivers).map(name => make('option', {}, name)));
    this.setFiles(answer.files);
    this.steps.hidden = false;
    this.say('', '');
    this.describe(this.driver);
  }

  setFiles(files) {
    this.calibrated_file.replaceChildren(...files.map(name => make('option', {}, name)));
  }

  // Fields of the driver and rows of the channels, then the text. @param changed: the input that was changed
  describe(changed) {
    if (changed === this.driver) {
      this.option_inputs = this.drivers[this.driver.value].map(({ key, meaning }) => [key, text({ id: `instrument-option-${key}`, title: meaning, placeholder: meaning })]);
      this.options.replaceChildren(...this.option_inputs.map(([key, input]) => labelled(key, input)));
      for (const [, input] of this.option_inputs) input.addEventListener('change', () => this.writeText());
    }
    const count = Math.max(1, Math.min(64, Math.round(+this.count.value) || 1));
    this.channels = Array.from({ length: count }, (_, c) => this.channels?.[c] ?? {
      input: text({ size: 2 }, `${c + 1}`), topic: text({ size: 14 }, 'daq/vibration'), name: text({ size: 5 }, `c${c + 1}`), unit: select(UNITS), sensitivity: text({ size: 7 }, '1.0'),
      range: text({ size: 5 }, '10.0'), coupling: select(COUPLINGS) });
    this.rows.replaceChildren(table(['Input', 'Topic', 'Name', 'Unit', 'V/unit', 'Range [V]', ''], this.channels.map(c => Object.values(c)), { id: 'instrument-channels' }));
    for (const channel of this.channels) for (const input of Object.values(channel)) input.onchange = () => this.writeText();
    this.writeText();
  }

  writeText() {
    const options = this.option_inputs.filter(([, input]) => input.value).map(([key, input]) => `${key}: ${yaml(input.value)}`);
    const lines = ['format: smartmill-instrument/1', `name: ${yaml(this.name.value)}`, `driver: ${this.driver.value}`];
    if (options.length) lines.push(`options: {${options.join(', ')}}`);
    lines.push(`sample_rate: ${this.rate.value}   # [Hz]`, 'streams:');
    for (const topic of new Set(this.channels.map(c => c.topic.value))) {
      lines.push(`  - topic: ${yaml(topic)}`);
      if (topic === DYNAMOMETER) lines.push('    frame: dynamometer   # tf2 frame of the sensor');
      lines.push('    channels:');
      for (const c of this.channels.filter(one => one.topic.value === topic))
        lines.push(`      - {input: ${yaml(c.input.value)}, name: ${yaml(c.name.value)}, unit: ${yaml(c.unit.value)}, sensitivity: ${c.sensitivity.value}, range: ${c.range.value}, coupling: ${c.coupling.value}}`);
    }
    this.description.value = `${lines.join('\n')}\n`;
  }

  async read() {
    const answer = await this.access.post('instrument', { description: this.description.value, seconds: 1.0 });
    this.say(answer.good ? `${answer.samples} samples; drift ${withDeviation(PPM * answer.drift, PPM * answer.drift_std)} ppm after one second, arrivals late by ${digits(1e3 * answer.jitter)} ms` : answer.message, answer.good ? 'good' : 'bad');
    this.levels.replaceChildren(...(answer.channels?.length ? [table(['Channel', 'Level', 'Mean', 'RMS', 'Clipped', ''], answer.channels.map(c => [
      `${c.topic}/${c.name}`, bar(c.peak, c.faulty), `${digits(c.mean, 4)} ${c.unit}`, `${digits(c.rms, 4)} ${c.unit}`, `${c.clipped}`,
      c.faulty ? word('bad', 'no measurement') : c.rms > 0 ? word('good', 'alive') : word('warn', 'constant')])),
      ...answer.faults.map(fault => make('p', { class: 'bad' }, fault))] : []));
  }

  async write() {
    const answer = await this.access.post('instrument', { description: this.description.value, file: this.file.value, replace: this.replace.checked });
    this.say(answer.good ? `${answer.message}. Start it: roslaunch smartmill_daq daq.launch instrument:=${answer.path}` : answer.message, answer.good ? 'good' : 'bad');
    if (answer.files) this.setFiles(answer.files);
    if (answer.good) this.calibrated_file.value = this.file.value;
  }

  buildCalibration(card) {
    this.calibrated_file = select([], { id: 'calibrate-file' });
    this.where = { topic: text({ id: 'calibrate-topic' }, 'daq/vibration'), channel: text({ id: 'calibrate-channel' }, 'x') };
    const number = (id, value) => text({ id: `calibrate-${id}`, inputmode: 'decimal' }, value);
    this.quantity = { seconds: number('seconds', '5'), exciter: number('exciter', '10'), frequency: number('frequency', '159.155'), mass: number('mass', '1.0'), gravity: number('gravity', '9.80665'), reference_std: number('std', '0.015') };
    this.accelerometer = text({ id: 'calibrate-accelerometer' }, 'daq/vibration/x');
    this.against = make('input', { type: 'checkbox', id: 'calibrate-against' });
    this.result = make('p', { id: 'calibrate-answer' });
    const button = (method, title) => make('button', { 'data-method': method, onclick: () => this.calibrate(method) }, title);
    card.append(make('p', { class: 'dim' }, 'Takes a record of a known quantity, as smartmill sensitivity. The device is opened here: stop its daq_node first if the device serves one reader only.'),
      make('div', { class: 'row fields' }, labelled('Instrument', this.calibrated_file), labelled('Topic', this.where.topic), labelled('Channel', this.where.channel), labelled('Record [s]', this.quantity.seconds), labelled('Relative standard deviation of the known quantity', this.quantity.reference_std)),
      make('div', { class: 'row fields' }, labelled('Exciter, RMS [unit]', this.quantity.exciter), labelled('Frequency [Hz]', this.quantity.frequency), button('exciter', 'Exciter is on: record')),
      make('div', { class: 'row fields' }, labelled('Mass [kg]', this.quantity.mass), labelled('g [m/s²]', this.quantity.gravity), labelled('against the channel', this.against), button('empty', 'Without the mass: record'), button('mass', 'With the mass: record')),
      make('div', { class: 'row fields' }, labelled('Accelerometer on the mass', this.accelerometer), button('hits', 'Record while hitting')),
      this.result, this.store = make('button', { 'data-method': 'store', hidden: true, onclick: () => this.calibrate('store') }, 'Store this sensitivity'));
  }

  async calibrate(method) {
    this.result.textContent = method === 'store' ? '' : `recording ${this.quantity.seconds.value} s …`;
    this.result.className = '';
    const numbers = Object.fromEntries(Object.entries(this.quantity).map(([key, input]) => [key, +input.value]));
    const answer = await this.access.post('calibrate', { file: this.calibrated_file.value, topic: this.where.topic.value, channel: this.where.channel.value, method, accelerometer: this.accelerometer.value,
      against: this.against.checked, ...numbers });
    this.result.textContent = answer.message;
    this.result.className = answer.good ? 'good' : 'bad';
    this.store.hidden = !answer.good || method === 'store' || method === 'empty';
  }
}
