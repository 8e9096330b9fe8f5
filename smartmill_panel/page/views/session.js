// What the session has done, and what people noted.
import { clock, fixed, make, save, table } from '../format.js';

const STATES = ['running', 'done', 'failed', 'stopped'];
const COLOURS = ['warn', 'good', 'bad', 'warn'];

export class Session {
  constructor(card, link) {
    this.place = make('div', { class: 'dim' }, 'No session yet');
    card.append(this.place);
    this.card = card;
    link.on('session/state', message => { this.message = message; this.news = true; });
  }
  refresh() {
    if (!this.news) return;
    this.news = false;
    const m = this.message;
    this.card.aside.textContent = `${m.tool} in ${m.material}: ` + (m.running ? 'running' : m.completed ? 'completed' : 'ended before its end');
    this.place.className = '';
    this.place.replaceChildren(table(['', 'Step', 'Result', 'at [s]'], m.steps.map(s => [
      make('span', { class: COLOURS[s.state] }, STATES[s.state]), s.name, make('span', { class: 'dim' }, s.detail), fixed(s.elapsed, 1)]), { id: 'steps' }));
  }
}

// The running step, at the foot of every view.
export class Progress {
  constructor(place, link) {
    Object.assign(this, { place, link });
    link.on('session/state', () => {});
  }
  refresh() {
    const m = this.link.message('session/state'), last = m?.steps.at(-1);
    const text = !last ? '' : m.running ? `Session, step ${m.steps.length}: ${last.name}` : m.completed ? `Session completed, ${m.steps.length} steps` : `Session ended: ${last.name}: ${last.detail}`;
    if (text !== this.place.textContent) this.place.textContent = text;
  }
}

// Markers with a note: kept in this browser, and in the machine's log where commands are allowed.
export class Notes {
  constructor(card, link, commands) {
    Object.assign(this, { link, commands });
    this.notes = JSON.parse(localStorage.getItem('notes') ?? '[]');
    this.input = make('input', { type: 'text', placeholder: 'What was seen', maxlength: '200', 'aria-label': 'Note' });
    this.input.addEventListener('keydown', event => { if (event.key === 'Enter') this.add(); });
    this.list = make('div');
    card.append(make('div', { class: 'row' }, this.input, make('button', { onclick: () => this.add() }, 'Mark'),
      make('button', { onclick: () => save('notes.csv', this.csv(), 'text/csv') }, 'CSV')), this.list);
    link.on('cut/condition', () => {});
    this.draw();
  }
  add() {
    const text = this.input.value.trim();
    if (!text) return;
    this.notes.unshift({ time: Date.now() / 1000, cut: this.link.message('cut/condition')?.name ?? '', text });
    this.notes.length = Math.min(this.notes.length, 200);
    localStorage.setItem('notes', JSON.stringify(this.notes));
    this.input.value = '';
    if (this.commands.unlocked) this.commands.send({ command: 'mark', text });
    this.draw();
  }
  csv() { return 'time,cut,note\n' + this.notes.map(n => `${new Date(1000 * n.time).toISOString()},${n.cut},"${n.text.replaceAll('"', '""')}"`).join('\n') + '\n'; }
  draw() { this.list.replaceChildren(table(['Time', 'Cut', 'Note'], this.notes.map(n => [clock(n.time), n.cut, n.text]))); }
}

// A recording that is played: how far, how fast. It commands no machine.
export class Replay {
  constructor(place, link) {
    Object.assign(this, { link, place });
    this.slider = make('input', { type: 'range', min: 0, max: 1, step: 'any', 'aria-label': 'Place in the recording', onchange: () => this.send({ position: this.slider.value }), oninput: () => { this.held = true; } });
    this.told = make('span', { class: 'dim' });
    this.pause = make('button', { onclick: () => this.send({ paused: this.message.paused ? 0 : 1 }) }, 'Pause');
    this.speeds = [[0.2, '0.2×'], [1, '1×'], [5, '5×'], [0, 'as fast as it goes']].map(([speed, name]) => make('button', { 'data-speed': speed, onclick: () => this.send({ speed, paused: 0 }) }, name));
    place.append(this.pause, this.slider, this.told, make('span', { class: 'choice row' }, ...this.speeds));
    link.on('replay/state', message => { this.message = message; this.news = true; });
  }
  send(wish) {
    this.held = false;
    const query = new URLSearchParams({ paused: this.message.paused ? 1 : 0, ...wish });
    fetch(`api/replay?${query}`, { method: 'POST' }).catch(() => null);
  }
  refresh() {
    if (!this.news) return;
    this.news = false;
    const m = this.message;
    this.place.hidden = false;
    this.slider.max = m.length;
    if (!this.held) this.slider.value = m.position;
    this.pause.textContent = m.paused ? 'Play' : 'Pause';
    this.told.textContent = `${m.name}  ${fixed(m.position, 1)} of ${fixed(m.length, 1)} s`;
    for (const b of this.speeds) b.setAttribute('aria-pressed', String(+b.dataset.speed === m.speed));
  }
}
