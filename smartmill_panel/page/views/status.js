// Status line: connection, arming, mode, alarms, chatter, and the age of the data.
import { age, make } from '../format.js';

const MODES = { 0: 'MDI', 1: 'MEM', 3: 'EDIT', 4: 'HANDLE', 5: 'JOG', 8: 'INC', 9: 'REFERENCE', 10: 'DNC' };
const RUNS = ['idle', 'stopped', 'held', 'running'];
export const STALE_AGE = 1.0;  // [s] of a state that is published several times a second

export class StatusLine {
  constructor(element, link, name, short = false) {
    Object.assign(this, { element, link, name, short });
    for (const topic of ['cnc/state', 'chatter/state', 'cut/condition', 'force/sensor']) link.on(topic, () => {});
  }

  words() {
    const { link } = this, state = link.message('cnc/state'), old = link.age('cnc/state');
    if (!link.alive) return [['bad', 'Panel does not answer']];
    if (!state) return [['warn', 'No data from the controller yet']];
    if (!state.connected) return [['bad', 'Controller not connected']];
    const words = [];
    const replay = link.message('replay/state');
    if (old > STALE_AGE && replay && (replay.paused || replay.position >= replay.length - STALE_AGE))
      words.push(['warn', replay.paused ? 'Recording paused' : 'Recording at its end']);
    else if (old > STALE_AGE) words.push(['bad', 'Controller silent']);
    if (state.emergency) words.push(['bad', 'EMERGENCY STOP']);
    if (state.alarm) words.push(['bad', `Alarm ${state.alarm_text}`]);
    const sensor = link.message('force/sensor');
    if (sensor && !sensor.calibrated) words.push(['bad', `Sensor ${sensor.sensor} not calibrated`]);
    if (!this.short) {
      if (old <= STALE_AGE) words.push(['good', 'Connected']);
      words.push(state.armed ? ['warn', 'Armed'] : ['plain', 'Disarmed']);
      words.push(['plain', MODES[state.mode] ?? `mode ${state.mode}`], ['plain', RUNS[state.run] ?? '']);
      if (sensor?.calibrated && sensor.sensor !== 'table') words.push(['plain', `Sensor ${sensor.sensor}, calibrated`]);
      if (!state.alarm && !state.emergency && old <= STALE_AGE) words.push(['plain', 'no alarm']);
    } else if (!words.length) {
      words.push(['good', RUNS[state.run]]);
    }
    if (link.message('chatter/state')?.chatter && link.message('cut/condition')?.kind === 2 && link.age('chatter/state') < 3) words.push(['bad', 'Chatter']);
    return words;
  }

  refresh() {
    const words = this.words(), link = this.link, old = link.age('cnc/state');
    const age_text = link.alive && Number.isFinite(old) ? `data ${age(old)} old` : link.alive ? '' : `last data ${age(old)} ago`;
    const text = JSON.stringify([words, this.short ? '' : age_text]);
    if (text === this.drawn_text) return;
    this.drawn_text = text;
    const stale = !link.alive || old > STALE_AGE;
    this.element.classList.toggle('gone', !link.alive);
    this.element.replaceChildren(make('span', { class: 'name' }, this.name),
      ...words.map(([kind, word]) => make('span', { class: `word ${kind}${stale && kind !== 'bad' ? ' stale' : ''}` }, word)),
      this.short ? '' : make('span', { class: `age${link.alive ? '' : ' lost'}` }, age_text));
  }
}
