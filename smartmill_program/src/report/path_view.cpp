#include "smartmill_program/report/path_view.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using units::degFromRad;
using units::MM;

constexpr double MOST_MARGIN = 3.0;  // [1] scale of the stability margin; a larger one has no consequence
constexpr double SAME_VALUE = 0.01;  // [1] within a piece: less than a step of colour

struct Quantity {
  const char* name;
  const char* title;
  bool reversed;  // low values are red
};
constexpr std::array<Quantity, PathView::QUANTITIES> ALL{{{"force", "peak force [N]", false},
                                                          {"torque", "peak torque [N m]", false},
                                                          {"power", "power [W]", false},
                                                          {"depth", "axial depth [mm]", false},
                                                          {"immersion", "immersion [deg]", false},
                                                          {"margin", "stability limit / axial depth", true},
                                                          {"chatter", "probability of chatter", false},
                                                          {"chip", "chip thickness [mm]", false},
                                                          {"deflection", "tip deflection [um]", false},
                                                          {"surface", "surface location error [um]", false}}};

std::array<double, PathView::QUANTITIES> valuesOf(const Step& step, const StepPrediction& prediction) {
  std::array<double, PathView::QUANTITIES> values{};
  values.fill(std::numeric_limits<double>::quiet_NaN());
  if (step.contact.empty()) return values;
  const double depth = step.contact.axialDepth();
  return {prediction.force.peak_force,
          prediction.force.peak_torque,
          prediction.power,
          depth / MM,
          degFromRad(step.contact.exit() - step.contact.entry()),
          std::isnan(prediction.limit) ? prediction.limit : std::min(prediction.limit / depth, MOST_MARGIN),
          prediction.chatter,
          prediction.chip / MM,
          prediction.deflection / units::UM,
          prediction.wall_error / units::UM};
}

bool alike(double a, double b) {
  return (std::isnan(a) && std::isnan(b)) ||
         std::abs(a - b) <= SAME_VALUE * std::max(std::abs(a), std::abs(b));
}

constexpr const char* SCRIPT = R"JS(
(() => {
const v = PATH_VIEW, canvas = document.getElementById('path'), box = document.getElementById('quantity'),
  scale = document.getElementById('scale'), reading = document.getElementById('reading'), draw2d = canvas.getContext('2d');
const colours = ['#2c7bb6', '#00a6ca', '#00ccbc', '#5fc75f', '#b5c93b', '#f4b13c', '#ee6f3a', '#d7191c'], air = '#8896a4';
const n = v.line.length, mid = [0, 1, 2].map(a => (v.low[a] + v.high[a]) / 2);
const size = Math.hypot(v.high[0] - v.low[0], v.high[1] - v.low[1], v.high[2] - v.low[2]) || 1;
let turn = 0, tilt = 0, zoom = 1, shift = [0, 0], bins = [], low = 0, high = 0, drawn = [];
v.names.forEach((name, k) => box.add(new Option(name, k, false, k === v.first)));
function choose() {
  const values = v.values[box.value].filter(x => x !== null);
  low = values.reduce((a, b) => Math.min(a, b), Infinity); high = values.reduce((a, b) => Math.max(a, b), -Infinity);
  bins = Array.from({length: colours.length + 1}, () => []);
  v.values[box.value].forEach((x, k) => {
    let i = x === null ? colours.length : high > low * (1 + 1e-6) || high - low > 1e-6 * Math.abs(high)
      ? Math.min(colours.length - 1, Math.floor((x - low) / (high - low) * colours.length)) : colours.length - 1;
    if (x !== null && v.reversed[box.value]) i = colours.length - 1 - i;
    bins[i].push(k);
  });
  const order = v.reversed[box.value] ? [...colours].reverse() : colours;
  scale.innerHTML = values.length ? low.toPrecision(4) + ' ' + order.map(c => `<span style="color:${c}">\u25a0</span>`).join('') +
    ' ' + high.toPrecision(4) : 'no values';
  paint();
}
function project(x, y, z) {
  x -= mid[0]; y -= mid[1]; z -= mid[2];
  const c = Math.cos(turn), s = Math.sin(turn), ct = Math.cos(tilt), st = Math.sin(tilt);
  const u = c * x - s * y, w = s * x + c * y, k = zoom * 0.85 * Math.min(canvas.width, canvas.height) / size;
  return [canvas.width / 2 + shift[0] + k * u, canvas.height / 2 + shift[1] - k * (w * ct + z * st)];
}
function paint() {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = canvas.clientWidth * ratio; canvas.height = canvas.clientHeight * ratio;
  draw2d.lineCap = 'round'; draw2d.strokeStyle = air; draw2d.lineWidth = ratio; draw2d.globalAlpha = 0.5;
  draw2d.beginPath();
  for (let i = 0; i < 8; ++i) for (let a = 0; a < 3; ++a) if (!(i >> a & 1)) {
    const corner = j => project(...[0, 1, 2].map(b => (j >> b & 1 ? v.stock_high : v.stock_low)[b]));
    draw2d.moveTo(...corner(i)); draw2d.lineTo(...corner(i | 1 << a));
  }
  draw2d.stroke(); draw2d.globalAlpha = 1;
  drawn = new Float32Array(4 * n);
  for (let k = 0; k < n; ++k) {
    const p = 6 * k, a = project(v.at[p], v.at[p + 1], v.at[p + 2]), b = project(v.at[p + 3], v.at[p + 4], v.at[p + 5]);
    drawn.set([a[0], a[1], b[0], b[1]], 4 * k);
  }
  [colours.length, ...colours.keys()].forEach(i => {
    draw2d.strokeStyle = i < colours.length ? colours[i] : air;
    draw2d.lineWidth = (i < colours.length ? 2 : 1) * ratio;
    draw2d.beginPath();
    for (const k of bins[i]) { draw2d.moveTo(drawn[4 * k], drawn[4 * k + 1]); draw2d.lineTo(drawn[4 * k + 2], drawn[4 * k + 3]); }
    draw2d.stroke();
  });
}
function nearest(event) {
  const ratio = window.devicePixelRatio || 1, x = event.offsetX * ratio, y = event.offsetY * ratio;
  let best = 8 * ratio, found = -1;
  for (let k = 0; k < n; ++k) {
    const ax = drawn[4 * k], ay = drawn[4 * k + 1], dx = drawn[4 * k + 2] - ax, dy = drawn[4 * k + 3] - ay;
    const t = Math.max(0, Math.min(1, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1)));
    const d = Math.hypot(x - ax - t * dx, y - ay - t * dy);
    if (d < best) { best = d; found = k; }
  }
  const value = found < 0 ? null : v.values[box.value][found];
  reading.textContent = found < 0 ? '' : `line ${v.line[found]}: ` + (value === null ? 'no value' : value);
}
let held = null;
canvas.addEventListener('pointerdown', e => { held = e; canvas.setPointerCapture(e.pointerId); e.preventDefault(); });
canvas.addEventListener('pointerup', () => held = null);
canvas.addEventListener('contextmenu', e => e.preventDefault());
canvas.addEventListener('pointermove', e => {
  if (!held) return nearest(e);
  const ratio = window.devicePixelRatio || 1;
  if (e.shiftKey || e.buttons === 2) { shift[0] += e.movementX * ratio; shift[1] += e.movementY * ratio; }
  else { turn += e.movementX * 0.01; tilt = Math.max(0, Math.min(Math.PI, tilt - e.movementY * 0.01)); }
  paint();
});
canvas.addEventListener('wheel', e => {
  const ratio = window.devicePixelRatio || 1, k = Math.exp(-e.deltaY * 0.0015);
  const x = e.offsetX * ratio - canvas.width / 2, y = e.offsetY * ratio - canvas.height / 2;
  shift = [x - k * (x - shift[0]), y - k * (y - shift[1])]; zoom *= k; e.preventDefault(); paint();
}, {passive: false});
canvas.addEventListener('dblclick', () => { turn = tilt = 0; zoom = 1; shift = [0, 0]; paint(); });
box.addEventListener('change', choose);
window.addEventListener('resize', paint);
window.addEventListener('beforeprint', paint);
choose();
})();
)JS";

}  // namespace

const std::vector<std::string>& colourNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const Quantity& quantity : ALL) all.emplace_back(quantity.name);
    return all;
  }();
  return names;
}

PathView::PathView(const StockBlock& block, const std::string& colour) : block_(block) {
  const auto& names = colourNames();
  const auto found = std::find(names.begin(), names.end(), colour);
  if (found == names.end()) throw Error("colour " + colour + ": expected " + joined(names));
  first_ = static_cast<std::size_t>(found - names.begin());
}

bool PathView::continues(const Piece& piece) const {
  if (pieces_.empty() || piece.move->path.isArc()) return false;
  const Piece& last = pieces_.back();
  return last.move == piece.move && last.end == piece.start &&
         std::equal(last.value.begin(), last.value.end(), piece.value.begin(), alike);
}

void PathView::add(const Step& step, const StepPrediction& prediction) {
  if (step.move->rapid) return;
  const Piece piece{step.move->line, step.move, step.start, step.end, valuesOf(step, prediction)};
  if (continues(piece)) {
    pieces_.back().end = piece.end;
  } else {
    pieces_.push_back(piece);
  }
}

void PathView::write(std::ostream& html) const {
  nc::PathSegment::Point low = block_.low, high = block_.high;
  for (const Piece& piece : pieces_) {
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = std::min({low[a], piece.start[a], piece.end[a]});
      high[a] = std::max({high[a], piece.start[a], piece.end[a]});
    }
  }
  const auto point = [&](const nc::PathSegment::Point& p) {
    html << formatted("%.6g,%.6g,%.6g", p[0] / MM, p[1] / MM, p[2] / MM);
  };
  html << "<figure><p><label>Colour: <select id=\"quantity\"></select></label> <span id=\"scale\"></span> "
          "<output id=\"reading\"></output></p><canvas id=\"path\" "
          "style=\"width:100%;height:60vh;touch-action:none\">"
          "</canvas><figcaption>Tool path; grey: air and the edges of the stock. Drag to turn, with the "
          "right button "
          "or Shift to move, wheel to zoom, double click for the view from "
          "above.</figcaption></figure>\n<script>\n"
          "const PATH_VIEW = {";
  const auto box = [&](const char* name, const nc::PathSegment::Point& p) {
    html << name << ":[";
    point(p);
    html << "],";
  };
  box("low", low);
  box("high", high);
  box("stock_low", block_.low);
  box("stock_high", block_.high);
  html << "first:" << first_ << ",names:[";
  for (const Quantity& quantity : ALL) html << "'" << quantity.title << "',";
  html << "],reversed:[";
  for (const Quantity& quantity : ALL) html << (quantity.reversed ? "true," : "false,");
  html << "],line:[";
  for (const Piece& piece : pieces_) html << piece.line << ",";
  html << "],\nat:[";
  for (const Piece& piece : pieces_) {
    point(piece.start);
    html << ",";
    point(piece.end);
    html << ",";
  }
  html << "],\nvalues:[";
  for (std::size_t k = 0; k < QUANTITIES; ++k) {
    html << "[";
    for (const Piece& piece : pieces_) {
      const double value = piece.value[k];
      html << (std::isfinite(value) ? formatted("%.4g,", value) : "null,");
    }
    html << "],\n";
  }
  html << "]};" << SCRIPT << "</script>\n";
}

}  // namespace smartmill::program
