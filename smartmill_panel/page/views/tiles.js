// Large values, legible from two metres.
import { fixed, make, rpm } from '../format.js';
import { STALE_AGE } from './status.js';

const HISTORY = 60;  // [1] windows of the chatter detection
const VERDICT_STALE_AGE = 3.0;  // [s] of a verdict on a running cut

class Tile {
  constructor(parent, what, extra = '') {
    this.what = make('div', { class: 'what' }, what);
    this.value = make('div', { class: 'value' }, '–');
    this.more = make('div', { class: 'more' });
    this.element = make('div', { class: `tile ${extra}` }, this.what, this.value);
    this.extra = extra;
    parent.append(this.element);
  }
  set(value, more, stale, kind = '') {
    const text = JSON.stringify([value, more, stale, kind]);
    if (text === this.drawn_text) return;
    this.drawn_text = text;
    this.value.textContent = value;
    this.value.classList.toggle('stale', stale);
    this.more.textContent = more;
    this.more.classList.toggle('stale', stale);
    this.element.className = `tile ${this.extra} ${stale ? '' : kind}`;
  }
  setBar(bar, share) {
    bar.firstChild.style.width = `${Math.max(0, Math.min(1, share || 0)) * 100}%`;
    bar.className = `bar ${share > 1 ? 'bad' : share > 0.85 ? 'warn' : ''}`;
  }
}

const bar = () => make('div', { class: 'bar' }, make('i'));

export class Tiles {
  constructor(parent, link) {
    this.link = link;
    this.verdicts = [];
    const place = make('div', { class: 'tiles' });
    parent.append(place);
    this.lamp = new Tile(place, 'Cut', 'lamp');
    this.history = make('div', { class: 'history', title: 'last verdicts, newest on the right' });
    this.lamp.element.append(this.history, this.lamp.more);
    this.spindle = new Tile(place, 'Spindle [rpm]');
    this.spindleBar = bar();
    this.load = new Tile(place, 'Spindle load [%]');
    this.loadBar = bar();
    this.feed = new Tile(place, 'Feed [mm/min]');
    this.tool = new Tile(place, 'Tool');
    this.tool.element.append(make('div', { style: 'height: 18px' }), this.tool.more);
    this.spindle.element.append(this.spindleBar, this.spindle.more);
    this.load.element.append(this.loadBar, this.load.more);
    this.feed.element.append(make('div', { style: 'height: 18px' }), this.feed.more);
    this.places = new Tile(place, 'Position, to go [mm]', 'places');
    this.places.value.remove();
    this.axes = make('div', { class: 'axes' });
    this.places.element.append(this.axes);
    for (const topic of ['cnc/load', 'cut/condition', 'chatter/advice', 'stability/chart', 'tool/condition']) link.on(topic, () => {});
    link.on('chatter/state', message => this.addVerdict(message));
    link.on('replay/state', message => {
      if (message.position < this.position) this.verdicts = [];
      this.position = message.position;
    });
  }

  // Latched messages may arrive in any order.
  addVerdict(message) {
    this.verdicts = this.verdicts.filter(v => v.header.stamp !== message.header.stamp);
    this.verdicts.push(message);
    this.verdicts.sort((a, b) => a.header.stamp - b.header.stamp);
    if (this.verdicts.length > 600) this.verdicts.shift();
  }

  refresh() {
    const { link } = this, gone = !link.alive;
    const stale = gone || link.age('cnc/state') > STALE_AGE, state = link.message('cnc/state');
    const condition = link.message('cut/condition'), cutting = condition?.kind === 2;
    this.showLamp(gone, cutting, condition?.kind === 3);
    const most = link.message('stability/chart')?.spindle_speed.at(-1);
    this.spindle.set(state ? fixed(rpm(state.spindle_speed)) : '–',
      condition?.kind ? `commanded ${fixed(rpm(condition.spindle_speed))}` : most ? `up to ${fixed(rpm(most))}` : '', stale);
    this.spindle.setBar(this.spindleBar, stale ? 0 : state?.spindle_speed / most);
    const load = link.message('cnc/load'), load_stale = gone || link.age('cnc/load') > STALE_AGE;
    this.load.set(load ? fixed(100 * load.spindle_load, 1) : '–',
      load ? load.axes.map((axis, k) => `${axis} ${fixed(100 * load.axis_load[k])} %`).join('   ') : '', load_stale,
      load?.spindle_load > 1 ? 'bad' : '');
    this.load.setBar(this.loadBar, load_stale ? 0 : load?.spindle_load);
    this.feed.set(state ? fixed(60e3 * state.feed) : '–',
      cutting ? `${fixed(1e3 * condition.feed_per_tooth, 3)} mm/tooth, ${fixed(1e3 * condition.axial_depth, 2)} mm deep` : '', stale);
    this.showTool(stale);
    this.showPlaces(state, stale);
  }

  // A lost tooth remains until the tool changes; the wear is that of the last steady cut.
  showTool(stale) {
    const tool = this.link.message('tool/condition');
    if (!tool) return this.tool.set('–', '', stale);
    const wear = !Number.isFinite(tool.wear) ? '' : `wear ${fixed(tool.wear, 0)} ± ${fixed(tool.wear_std, 0)} %`;
    if (tool.broken) {
      this.tool.set(`Tooth ${tool.tooth} lost`, `${fixed(100 * tool.loss)} ± ${fixed(100 * tool.loss_std)} % of its force`, stale, 'bad');
    } else {
      this.tool.set(wear ? `${fixed(tool.wear, 0)} %` : 'No loss', wear ? `${wear}, ${tool.tool}` : tool.tool, stale);
    }
  }

  showLamp(gone, cutting, unsteady) {
    const { link } = this, last = this.verdicts.at(-1), advice = link.message('chatter/advice');
    const old = gone || (cutting && last?.valid && link.age('chatter/state') > VERDICT_STALE_AGE);
    const name = link.message('cut/condition')?.name ?? '';
    if (!last || !last.valid || !cutting) {
      this.lamp.set(cutting ? 'Entering' : unsteady ? 'Unsteady cut' : 'No cut', name, old, 'quiet');
    } else if (last.chatter) {
      const speed = advice && advice.condition === last.condition ? advice.speeds[0]?.spindle_speed : undefined;
      this.lamp.set('CHATTER', `${fixed(last.frequency)} Hz, ${fixed(last.severity)} N` +
        (speed ? `, try ${fixed(rpm(speed))} rpm` : ''), old, 'bad');
    } else {
      this.lamp.set('Stable', `${fixed(100 * last.energy_ratio, 1)} % off the harmonics`, old, 'good');
    }
    const recent = this.verdicts.filter(v => v.valid).slice(-HISTORY);
    const text = recent.map(v => v.chatter ? 'yes' : 'no').join();
    if (text === this.drawn) return;
    this.drawn = text;
    this.history.replaceChildren(...recent.map(v => make('i', { class: v.chatter ? 'yes' : 'no' })));
  }

  showPlaces(state, stale) {
    const text = state ? state.axes.map((axis, k) => [axis, fixed(1e3 * state.position[k], 3), fixed(1e3 * state.distance_to_go[k], 3)]) : [];
    const places_text = JSON.stringify([text, stale]);
    if (places_text === this.drawn_places) return;
    this.drawn_places = places_text;
    this.axes.classList.toggle('stale', stale);
    this.axes.replaceChildren(...text.flatMap(([axis, at, go]) => [make('span', { class: 'dim' }, axis.toUpperCase()), make('b', {}, at), make('span', { class: 'go' }, go)]));
  }
}
