// Commands, if the panel allows them: unlocked by a token for one minute.
import { make } from '../format.js';

const MINUTE = 60e3;

export class Commands {
  constructor(card, link, config) {
    Object.assign(this, { link, token: null, until: 0 });
    this.place = make('div');
    card.append(this.place);
    if (!config.commands) {
      this.place.append(make('p', { class: 'dim' }, 'This panel is read-only. Started with allow_commands and a token file, it can hold the feed, cancel, disarm, measure and install a model.'));
      return;
    }
    for (const topic of ['cut/condition', 'panel/log']) link.on(topic, () => {});
    this.who = make('input', { type: 'text', placeholder: 'Your name, for the log', maxlength: '40', value: localStorage.getItem('who') ?? '' });
    this.token_input = make('input', { type: 'password', placeholder: 'Token', autocomplete: 'off' });
    this.time_left = make('span', { class: 'dim' });
    this.file = make('input', { type: 'text', placeholder: 'model.yaml, full path' });
    const command = (name, title, fields = () => ({}), confirmed = true) => make('button', { 'data-command': name, onclick: () => {
      if (!confirmed || confirm(`${title}?`)) this.send({ command: name, ...fields() });
    } }, title);
    const cut = () => this.link.message('cut/condition');
    this.locked = make('div', { class: 'row' }, this.who, this.token_input, make('button', { id: 'unlock', onclick: () => this.unlock() }, 'Unlock for one minute'));
    this.open = make('div', { hidden: true }, make('div', { class: 'row' },
      command('hold', 'Feed hold', undefined, false), command('cancel', 'Cancel all actions', undefined, false), command('disarm', 'Disarm motion', undefined, false),
      command('measure_frf', 'Measure the FRF in x', () => ({ direction: 'x', tool: cut()?.tool ?? '' })),
      command('measure_frf', 'Measure the FRF in y', () => ({ direction: 'y', tool: cut()?.tool ?? '' })),
      command('identify', 'Identify coefficients', () => ({ tool: cut()?.tool ?? '', material: cut()?.material ?? '' }))),
      make('div', { class: 'row', style: 'margin-top: 8px' }, this.file, command('install_model', 'Install this model', () => ({ file: this.file.value }))), this.time_left);
    this.answer = make('p', { id: 'command-answer' });
    this.place.append(this.locked, this.open, this.answer, make('p', { class: 'dim' }, 'This is not an emergency stop: use that of the machine.'));
  }

  get unlocked() { return this.token !== null; }

  unlock() {
    if (!this.token_input.value || !this.who.value) return;
    this.token = this.token_input.value;
    this.token_input.value = '';
    localStorage.setItem('who', this.who.value);
    this.until = performance.now() + MINUTE;
    this.refresh();
  }

  async send(command) {
    const answer = await fetch('api/command', { method: 'POST', headers: { 'X-SmartMill-Token': this.token ?? '' }, body: JSON.stringify({ ...command, who: this.who.value }) }).catch(() => null);
    const answered = await answer?.json().catch(() => null);
    this.answer.textContent = answered?.message ?? 'The panel does not answer.';
    this.answer.className = answer?.ok ? 'good' : 'bad';
    if (answer?.status === 401) this.token = null;
    this.refresh();
  }

  refresh() {
    if (!this.open) return;
    if (performance.now() > this.until) this.token = null;
    this.open.hidden = !this.unlocked;
    this.locked.hidden = this.unlocked;
    if (this.unlocked) this.time_left.textContent = `locks in ${Math.ceil((this.until - performance.now()) / 1000)} s`;
  }
}
