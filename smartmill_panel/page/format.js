// Formatted numbers, and helpers for elements.
export const rpm = speed => 60 * speed / (2 * Math.PI);
export const radPerSec = value => 2 * Math.PI * value / 60;
export const deg = angle => 180 * angle / Math.PI;

export function fixed(value, digits = 0, none = '–') {
  return Number.isFinite(value) ? value.toFixed(digits) : none;
}

// Significant digits in fixed notation.
export function digits(value, count = 3, none = '–') {
  if (value === Infinity) return '∞';
  if (!Number.isFinite(value)) return none;
  if (value === 0) return '0';
  const places = Math.max(0, count - 1 - Math.floor(Math.log10(Math.abs(value))));
  return value.toFixed(Math.min(places, 12));
}

// value ± standard deviation, rounded to the deviation's first significant digit (to two if the first is 1).
export function withDeviation(value, deviation) {
  if (!Number.isFinite(value)) return '–';
  if (!(deviation > 0)) return digits(value, 4);
  const power = Math.floor(Math.log10(deviation)), places = Math.min(12, Math.max(0, (deviation < 2 * 10 ** power ? 1 : 0) - power));
  return `${value.toFixed(places)} ± ${deviation.toFixed(places)}`;
}

export function age(seconds) {
  if (!Number.isFinite(seconds)) return 'no data';
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  if (seconds < 120) return `${Math.round(seconds)} s`;
  return seconds < 7200 ? `${Math.round(seconds / 60)} min` : `${Math.round(seconds / 3600)} h`;
}

export function clock(seconds) {
  return new Date(1000 * seconds).toLocaleTimeString([], { hour12: false });
}

// An element with attributes and children.
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === 'class') element.className = value;
    else if (key.startsWith('on')) element.addEventListener(key.slice(2), value);
    else if (value !== null && value !== false) element.setAttribute(key, value === true ? '' : value);
  }
  element.append(...children.filter(child => child !== null && child !== undefined));
  return element;
}

export function table(head, rows, attributes = {}) {
  return make('table', attributes,
    make('thead', {}, make('tr', {}, ...head.map(word => make('th', {}, word)))),
    make('tbody', {}, ...rows.map(row => make('tr', {}, ...row.map(cell => make('td', {}, cell))))));
}

export function save(name, content, type) {
  const url = content instanceof Blob ? URL.createObjectURL(content) : URL.createObjectURL(new Blob([content], { type }));
  make('a', { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

// An object whose members are stored in localStorage at every change.
export function persistent(name, defaults) {
  let found = {};
  try { found = JSON.parse(localStorage.getItem(name)) ?? {}; } catch { /* unreadable: defaults */ }
  return new Proxy({ ...defaults, ...found }, {
    set(object, key, value) {
      object[key] = value;
      localStorage.setItem(name, JSON.stringify(object));
      return true;
    },
  });
}
