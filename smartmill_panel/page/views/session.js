// Steps of the session, notes, replay of a recording.
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
    this.card.aside.textContent = `${m.tool} in ${m.material}: ` + (m.running ? 'running' : m.completed ? 'completed' : 'ended early');
    this.place.className = '';
    this.place.replaceChildren(table(['', 'Step', 'Result', 'at [s]'], m.steps.map(s => [
      make('span', { class: COLOURS[s.state] }, STATES[s.state]), s.name, make('span', { class: 'dim' }, s.detail), fixed(s.elapsed, 1)]), { id: 'steps' }));
  }
}

// The running step, in the footer.
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

// Notes on the topic panel/log: shown by every page and contained in recordings.
export class Notes {
  constructor(card, link) {
    Object.assign(this, { link, list: [] });
    this.input = make('input', { type: 'text', placeholder: 'Observation', maxlength: '200', 'aria-label': 'Note' });
    this.input.addEventListener('keydown', event => { if (event.key === 'Enter') this.add(); });
    this.reply = make('div', { class: 'dim' });
    this.place = make('div');
    card.append(make('div', { class: 'row' }, this.input, make('button', { id: 'mark', onclick: () => this.add() }, 'Mark'),
      make('button', { onclick: () => save('notes.csv', this.csv(), 'text/csv') }, 'CSV')), this.reply, this.place);
    link.on('cut/condition', () => {});
    link.on('panel/log', message => this.addLine(message.data));
    this.draw();
  }
  // "TIME WHO (ADDRESS): mark: TEXT"; latched messages may arrive in any order.
  addLine(line) {
    const [, time, who, text] = line.match(/^([\d.]+) (.*?) \([^()]*\): mark: (.*)$/) ?? [];
    if (!text || this.list.some(n => n.time === +time && n.text === text)) return;
    this.list.push({ time: +time, who, text });
    this.list.sort((a, b) => b.time - a.time);
    this.list.length = Math.min(this.list.length, 200);
    this.draw();
  }
  async add() {
    const text = this.input.value.trim(), cut = this.link.message('cut/condition');
    if (!text) return;
    const where = cut?.kind && cut.name ? `${cut.name}: ` : '';
    const answer = await fetch('api/note', { method: 'POST', body: JSON.stringify({ who: localStorage.getItem('who') || 'page', text: where + text }) }).catch(() => null);
    this.reply.textContent = answer?.ok ? '' : 'The panel does not answer: the note was not stored.';
    if (answer?.ok) this.input.value = '';
  }
  csv() { return 'time,who,note\n' + this.list.map(n => `${new Date(1000 * n.time).toISOString()},"${n.who.replaceAll('"', '""')}","${n.text.replaceAll('"', '""')}"`).join('\n') + '\n'; }
  draw() { this.place.replaceChildren(this.list.length ? table(['Time', 'Who', 'Note'], this.list.map(n => [clock(n.time), n.who, n.text]), { id: 'notes' }) : ''); }
}

// Controls of a replayed recording: position and speed. Commands no machine.
export class Replay {
  constructor(place, link) {
    Object.assign(this, { link, place });
    this.slider = make('input', { type: 'range', min: 0, max: 1, step: 'any', 'aria-label': 'Position in the recording', onchange: () => this.send({ position: this.slider.value }), oninput: () => { this.held = true; } });
    this.reply = make('span', { class: 'dim' });
    this.pause = make('button', { onclick: () => this.send({ paused: this.message.paused ? 0 : 1 }) }, 'Pause');
    this.speeds = [[0.2, '0.2×'], [1, '1×'], [5, '5×'], [0, 'maximum']].map(([speed, name]) => make('button', { 'data-speed': speed, onclick: () => this.send({ speed, paused: 0 }) }, name));
    place.append(this.pause, this.slider, this.reply, make('span', { class: 'choice row' }, ...this.speeds));
    link.on('replay/state', message => { this.message = message; this.news = true; });
  }
  send(request) {
    this.held = false;
    const query = new URLSearchParams({ paused: this.message.paused ? 1 : 0, ...request });
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
    this.reply.textContent = `${m.name}  ${fixed(m.position, 1)} of ${fixed(m.length, 1)} s`;
    for (const b of this.speeds) b.setAttribute('aria-pressed', String(+b.dataset.speed === m.speed));
  }
}
