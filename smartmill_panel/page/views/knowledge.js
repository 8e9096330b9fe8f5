// The stored coefficients of a tool in a material, and the next test (loadmeter/find_coefficients).
import { deg, fixed, make, rpm, table, withDeviation } from '../format.js';

const COEFFICIENTS = [['ktc', 'Ktc', 1e-6, 'N/mm²'], ['krc', 'Krc', 1e-6, 'N/mm²'], ['kac', 'Kac', 1e-6, 'N/mm²'],
  ['kte', 'Kte', 1e-3, 'N/mm'], ['kre', 'Kre', 1e-3, 'N/mm'], ['kae', 'Kae', 1e-3, 'N/mm']];
const CONDITIONS = [['cutting_speed', 'Cutting speed', 60, 0, 'm/min'], ['feed_per_tooth', 'Feed per tooth', 1e3, 3, 'mm'],
  ['axial_depth', 'Axial depth', 1e3, 2, 'mm'], ['edge_age', 'Cutting time of the edge', 1 / 60, 1, 'min']];

const immersion = test => deg(test.exit_angle - test.entry_angle) > 179 ? 'slot' : `half immersion, ${test.entry_angle < 0.1 ? 'up' : 'down'} milling`;

export class Knowledge {
  constructor(card, link, what_if) {
    Object.assign(this, { what_if });
    this.tool = make('input', { id: 'knowledge-tool', 'aria-label': 'Tool', placeholder: 'Tool' });
    this.material = make('input', { id: 'knowledge-material', 'aria-label': 'Material', placeholder: 'Material' });
    this.place = make('div', { id: 'knowledge', class: 'dim' }, 'Which tool in which material?');
    const fetchNow = () => this.fetchKnown();
    card.append(make('div', { class: 'row' }, this.tool, this.material, make('button', { id: 'knowledge-show', onclick: fetchNow }, 'Show')), this.place);
    const prefill = message => {
      if (!message.material || this.tool.value || this.material.value) return;
      this.tool.value = message.tool;
      this.material.value = message.material;
      this.fetchKnown();
    };
    link.on('cut/condition', prefill);
    link.on('material/coefficients', prefill);
  }

  async fetchKnown() {
    const query = new URLSearchParams({ tool: this.tool.value.trim(), material: this.material.value.trim() });
    const answer = await fetch(`api/coefficients?${query}`).catch(() => null);
    this.show(await answer?.json().catch(() => null) ?? { message: 'The panel does not answer.' });
  }

  show(found) {
    const file = make('p', { class: 'dim', id: 'knowledge-file' }, `Database: ${found.database || 'records of this run only'}`);
    this.place.className = '';
    if (!found.source) { this.place.replaceChildren(make('p', {}, found.message), file); return; }
    const rows = COEFFICIENTS.filter(([key]) => Number.isFinite(found[key]))
      .map(([key, name, scale, unit]) => [name, withDeviation(scale * found[key], scale * found[`${key}_std`]), unit]);
    const covered = CONDITIONS.filter(([key]) => Number.isFinite(found[key]?.[0]))
      .map(([key, name, scale, places, unit]) => [name, `${fixed(scale * found[key][0], places)} … ${fixed(scale * found[key][1], places)}`, unit]);
    this.place.replaceChildren(
      make('p', {}, `${found.tool} in ${found.material}: ${found.message}`, make('span', { class: 'dim' }, `, ${found.production_cuts} production cuts`)),
      table(['Coefficient', 'Value', ''], rows, { id: 'knowledge-coefficients' }),
      covered.length ? table(['Covered', '', ''], covered, { id: 'knowledge-covered' }) : '', ...this.next(found), file);
  }

  next(found) {
    const test = found.next_test;
    if (!test) return [];
    return [make('p', { id: 'knowledge-next' }, `Next test: ${immersion(test)}, ${fixed(rpm(test.spindle_speed))} rpm, ${fixed(1e3 * test.feed_per_tooth, 3)} mm per tooth, ` +
      `${fixed(1e3 * test.axial_depth, 2)} mm deep; then Ktc ± ${fixed(1e-6 * test.ktc_std, 1)} N/mm², Kte ± ${fixed(1e-3 * test.kte_std, 2)} N/mm.`),
    make('button', { id: 'knowledge-use', onclick: () => { this.what_if.fill(test); location.hash = 'stability'; } }, 'Show in the stability chart')];
  }
}
