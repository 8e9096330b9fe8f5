// The panel: one page for one machine. It shows topics as they arrive; commands only if the panel allows them.
import { NamespaceLink, Link } from './link.js';
import { persistent, make } from './format.js';
import { StatusLine } from './views/status.js';
import { Tiles } from './views/tiles.js';
import { ChartView, PointsTable } from './views/chart.js';
import { WhatIf } from './views/what_if.js';
import { Revolution, Spectrum, SpectrumCourse, Strips } from './views/forces.js';
import { Dynamics } from './views/dynamics.js';
import { Session, Progress, Notes, Replay } from './views/session.js';
import { Commands } from './views/commands.js';
import { Knowledge } from './views/knowledge.js';
import { Discrepancy, Report, Database, Diagnostics, ForceSensor } from './views/model.js';
import { Part } from './views/part.js';
import { Fleet } from './views/fleet.js';
import { Health } from './views/health.js';
import { FirstConnection, Instruments } from './views/instruments.js';

const REFRESH = 100;  // [ms]

const VIEWS = {
  overview: 'Overview', forces: 'Forces', part: 'Part', stability: 'Stability', dynamics: 'Dynamics', session: 'Session', model: 'Model', instruments: 'Instruments', fleet: 'Fleet', health: 'Health',
};

// A card with a title.
function card(title, extra = '') {
  const aside = make('span', { class: 'aside' });
  const element = make('section', { class: `card ${extra}` }, make('h2', {}, title, aside));
  element.aside = aside;
  return element;
}

// Default name of a machine, from its namespace.
const nameOf = namespace => namespace.replace(/\/smartmill$/, '').slice(1) || 'SmartMill';

class Page {
  constructor(config) {
    this.config = config;
    this.parts = [];
    const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
    this.link = new Link(`${scheme}://${location.host}/`, config.namespace);
    this.store = persistent('layout', { view: 'overview', axis: 'x', source: 1, part: 'magnitude' });
    this.status = new StatusLine(document.querySelector('#status'), this.link, config.name === 'SmartMill' ? nameOf(config.namespace) : config.name);
    this.parts.push(this.status);
    this.buildMachines();
    this.build();
    this.setTheme(localStorage.getItem('theme') ?? (matchMedia('(prefers-color-scheme: light)').matches ? 'light' : 'dark'));
    addEventListener('hashchange', () => this.show());
    this.show();
    setInterval(() => this.refresh(), REFRESH);
  }

  // Status lines of other machines, with links to their pages: those of other panels by their addresses, those in other
  // namespaces of the same ROS master automatically.
  buildMachines() {
    for (const address of this.config.machines)
      this.addMachine(new URL(address).host, new Link(address.replace(/^http/, 'ws'), this.config.namespace), () => address);
    const found = new Set([this.config.namespace]);
    this.link.onChannel = topic => {
      const namespace = topic.match(/^(.+)\/cnc\/state$/)?.[1];
      if (!namespace || found.has(namespace)) return;
      found.add(namespace);
      this.addMachine(nameOf(namespace), new NamespaceLink(this.link, namespace), async () => (await (await fetch('api/config')).json()).panels[namespace]);
    };
  }

  addMachine(name, link, addressOf) {
    const button = make('button', { 'data-machine': name, title: `Open the page of ${name}`, onclick: async () => {
      const address = await addressOf();
      if (address) location.href = address; else button.title = `${name} has no panel of its own: roslaunch smartmill_launch panel.launch in its namespace`;
    } });
    document.querySelector('#machines').append(button);
    this.parts.push(new StatusLine(button, link, name, true));
  }

  add(view, place, part) {
    part.view = view;
    this.parts.push(part);
    return part;
  }

  build() {
    const main = document.querySelector('main'), nav = document.querySelector('#views');
    this.views = {};
    for (const [name, title] of Object.entries(VIEWS)) {
      this.views[name] = make('div', { class: `view ${name}`, id: `view-${name}`, hidden: true });
      main.append(this.views[name]);
      nav.append(make('button', { 'data-view': name, onclick: () => { location.hash = name; } }, title));
    }
    nav.append(make('button', { id: 'theme', title: 'Light or dark', onclick: () => this.setTheme(this.theme === 'dark' ? 'light' : 'dark') }, '◐'));
    const { link, store } = this;
    const place = (view, title, extra, build) => {
      const element = card(title, extra);
      this.views[view].append(element);
      for (const part of [build(element)].flat()) this.add(view, element, part);
      return element;
    };

    this.add('overview', null, new Tiles(this.views.overview, link));
    place('overview', 'Stability', '', e => new ChartView(e, link, 'overview'));
    const right = make('div', { class: 'right' });
    this.views.overview.append(right);
    for (const [title, build] of [['Force over one revolution', e => new Revolution(e, link, store)], ['Spectrum', e => new Spectrum(e, link, store)]]) {
      const element = card(title);
      right.append(element);
      this.add('overview', element, build(element));
    }

    const notes = card('Notes', 'tools-free'), commands = card('Commands', 'tools-free');
    const log = new Notes(notes, link);
    place('forces', 'Forces of the last minute', 'wide', e => new Strips(e, link, store, log));
    place('forces', 'Spectrum', '', e => new Spectrum(e, link, store));
    place('forces', 'Force over one revolution', '', e => new Revolution(e, link, store, false));
    place('forces', 'Spectrum of the last minute', '', e => new SpectrumCourse(e, link, store));

    const lines = card('Lines to look at', 'tools-free');
    place('part', 'Part', 'tools-free', e => new Part(e, lines, link, store));
    this.views.part.append(lines);

    let chart = null, what_if = null;
    place('stability', 'Stability', '', e => chart = new ChartView(e, link, 'stability'));
    place('stability', 'What if', 'side what-if tools-free', e => what_if = new WhatIf(e, link, chart));
    place('stability', 'Recommended points', 'wide tools-free', e => new PointsTable(e, link));

    const dynamics = new Dynamics(this.views.dynamics, link, card, store);
    this.add('dynamics', null, dynamics);

    place('session', 'Session', 'tools-free', e => new Session(e, link));
    const column = make('div', { style: 'display: grid; gap: 12px' });
    this.views.session.append(column);
    column.append(notes, commands);
    this.add('session', commands, new Commands(commands, link, this.config));
    this.add(null, notes, log);
    this.add(null, null, new Replay(document.querySelector('#replay'), link));
    this.add(null, null, new Progress(document.querySelector('#foot'), link));

    place('model', 'Model fit', 'tools-free', e => [new Discrepancy(e, link), new Report(e, link)]);
    const more = make('div', { style: 'display: grid; gap: 12px' });
    this.views.model.append(more);
    const known = e => new Knowledge(e, link, what_if);
    for (const [title, build] of [['Cutting coefficients', e => new Database(e, link)], ['Tool and material', known], ['Force sensor', e => new ForceSensor(e, link)]]) {
      const element = card(title, 'tools-free');
      more.append(element);
      this.add('model', element, build(element));
    }

    this.add('instruments', null, new Instruments(this.views.instruments, link, card));
    this.add('instruments', null, new FirstConnection(this.views.instruments, card, this.config));
    this.add('fleet', null, new Fleet(this.views.fleet, link, card));

    const inputs = card('Messages of each input', 'wide tools-free');
    place('health', 'Nodes', 'tools-free', e => new Health(e, inputs, link));
    place('health', 'Diagnostics', 'tools-free', e => new Diagnostics(e, link));
    this.views.health.append(inputs);
  }

  setTheme(theme) {
    this.theme = theme;
    document.documentElement.dataset.theme = theme;
    localStorage.setItem('theme', theme);
    document.dispatchEvent(new Event('theme'));
  }

  show() {
    const wanted = location.hash.slice(1) || this.store.view;
    this.current = this.store.view = VIEWS[wanted] ? wanted : 'overview';
    for (const [name, element] of Object.entries(this.views)) element.hidden = name !== this.current;
    for (const button of document.querySelectorAll('nav button[data-view]'))
      button.dataset.view === this.current ? button.setAttribute('aria-current', 'page') : button.removeAttribute('aria-current');
    for (const part of this.parts) if (part.view === this.current) part.onShow?.();
    this.refresh();
  }

  refresh() {
    document.body.classList.toggle('gone', !this.link.alive);
    for (const part of this.parts) if (!part.view || part.view === this.current) part.refresh?.();
  }
}

async function start() {
  const answer = await fetch('api/config');
  window.smartmill = new Page(await answer.json());
}

start();
