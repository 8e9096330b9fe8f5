#include "smartmill_core/io/report_page.h"

#include <cmath>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "smartmill_core/io/text_file.h"

namespace smartmill {
namespace {

// The palette is that of smartmill_panel/page/style.css; a test of the panel compares them.
constexpr const char* STYLE = R"(
:root {
  --bg: #0f1419; --card: #171d24; --raised: #202830; --grid: #28313b; --text: #edf2f7; --dim: #9aa8b6;
  --x: #5aa9ff; --good: #4cc38a; --warn: #ffd24a; --bad: #ff6166; color-scheme: dark;
}
:root[data-theme=light] {
  --bg: #f2f4f7; --card: #ffffff; --raised: #e8edf2; --grid: #e2e7ec; --text: #131a21; --dim: #566472;
  --x: #0b63c5; --good: #14784a; --warn: #8a6100; --bad: #c3242b; color-scheme: light;
}
* { box-sizing: border-box; }
body { margin: 0; background: var(--bg); color: var(--text); font-variant-numeric: tabular-nums;
  font: 16px/1.45 "Inter", "Liberation Sans", "DejaVu Sans", system-ui, sans-serif; }
main { max-width: 1180px; margin: 0 auto; padding: 12px 16px 60px; }
h1 { font-size: 26px; line-height: 1.2; margin: 18px 64px 14px 0; overflow-wrap: anywhere; }
h2 { font-size: 18px; margin: 30px 0 8px; }
.verdict { background: var(--card); border-radius: 12px; padding: 14px 18px; font-size: 20px; }
.table { overflow-x: auto; background: var(--card); border-radius: 12px; padding: 6px 16px 8px; margin: 8px 0; }
table { border-collapse: collapse; width: 100%; font-size: 15px; }
th { text-align: left; font-weight: 500; color: var(--dim); padding: 6px 14px 6px 0; cursor: pointer;
  vertical-align: bottom; }
th[aria-sort=ascending]::after { content: " \25B4"; } th[aria-sort=descending]::after { content: " \25BE"; }
th:hover { color: var(--text); }
td { padding: 5px 14px 5px 0; border-top: 1px solid var(--grid); vertical-align: top; }
td.number { white-space: nowrap; }
figure { margin: 8px 0; } figcaption { color: var(--dim); font-size: 14px; }
figure img { max-width: 100%; border-radius: 12px; background: #fff; cursor: zoom-in; display: block; }
code { background: var(--raised); border-radius: 4px; padding: 1px 5px; }
.good { color: var(--good); } .bad { color: var(--bad); font-weight: 650; }
button { position: fixed; right: 14px; top: 14px; width: 44px; height: 44px; border: 0; border-radius: 10px;
  background: var(--raised); color: var(--text); font-size: 18px; cursor: pointer; z-index: 2; }
dialog { border: 0; padding: 0; width: 100vw; height: 100vh; max-width: none; max-height: none;
  background: #0f1419ee; overflow: hidden; touch-action: none; cursor: grab; }
dialog img { position: absolute; left: 0; top: 0; transform-origin: 0 0; background: #fff; user-select: none; }
dialog p { position: absolute; left: 16px; bottom: 8px; margin: 0; color: #edf2f7; }
details > summary { cursor: pointer; font-size: 18px; font-weight: 650; margin: 30px 0 8px; }
.dim { color: var(--dim); }
pre { background: var(--raised); border-radius: 8px; padding: 8px 12px; margin: 4px 0; overflow-x: auto; font-size: 14px; }
.level1 { background: #fdd49e; color: #131a21; } .level2 { background: #fc8d59; color: #131a21; }
.level3 { background: #d7301f; color: #ffffff; } .level4 { background: #7f0000; color: #ffffff; }
td[class*=level] { padding-left: 6px; border-left: 2px solid var(--card); }
.plots { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(440px, 100%), 1fr)); gap: 10px; }
.plot { background: var(--card); border-radius: 12px; padding: 8px 10px; break-inside: avoid; }
.plot h3 { font-size: 15px; font-weight: 500; margin: 0 0 4px; }
.plot svg { width: 100%; height: auto; display: block; touch-action: none; cursor: crosshair; }
.plot text { fill: var(--dim); font-size: 12px; } .plot .axis { stroke: var(--grid); stroke-width: 1; }
.plot p { margin: 2px 0 0; font-size: 13px; color: var(--dim); min-height: 18px; }
select { background: var(--raised); color: var(--text); border: 0; border-radius: 8px; padding: 8px 12px; font-size: 15px; }
@media (max-width: 700px) {
  .stack tr, .stack td { display: block; } .stack tr:first-child { display: none; }
  .stack tr + tr { border-top: 2px solid var(--dim); } .stack td { border: 0; }
  .stack td::before { content: attr(data-head); display: block; color: var(--dim); font-size: 13px; }
}
@page { size: A4; margin: 12mm; }
@media print {
  body, .verdict, .table, .plot { background: #fff; }
  button, select { display: none; } .table { overflow: visible; padding: 0; margin: 4px 0; }
  body { font-size: 12px; } h1 { font-size: 19px; margin: 0 0 6px; } h2, details > summary { font-size: 14px; margin: 12px 0 4px; }
  p, ul, ol { margin: 5px 0; } table { font-size: 11px; } th, td { padding: 2px 8px 2px 0; } pre { font-size: 10px; white-space: pre-wrap; }
  .verdict { font-size: 14px; padding: 0; }
  main { max-width: none; padding: 0; } tr, figure { break-inside: avoid; } h2 { break-after: avoid; }
  .page { break-before: page; } .plots { grid-template-columns: 1fr 1fr; }
  td[class*=level] { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
)";

constexpr const char* SCRIPT = R"(
const root = document.documentElement;
const setTheme = theme => { root.dataset.theme = theme; };
setTheme(matchMedia('(prefers-color-scheme: light)').matches ? 'light' : 'dark');
addEventListener('beforeprint', () => { setTheme('light'); for (const part of document.querySelectorAll('details')) part.open = true; });
document.querySelector('button').onclick = () => setTheme(root.dataset.theme === 'dark' ? 'light' : 'dark');

const numberIn = text => { const found = text.match(/^[^\d\-+.]*([-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?)/i); return found ? +found[1] : NaN; };
for (const table of document.querySelectorAll('table')) {
  const [head, ...rows] = table.rows, body = rows[0]?.parentNode;
  const box = document.createElement('div');
  box.className = 'table'; table.replaceWith(box); box.append(table);
  for (const row of rows) for (const cell of row.cells) {
    if (/^[-+<>=\d.e %]+$/.test(cell.textContent) && /\d/.test(cell.textContent)) cell.classList.add('number');
    cell.dataset.head = head.cells[cell.cellIndex]?.textContent ?? '';
    if (/^(met|yes)$/.test(cell.textContent)) cell.className = 'good';
    if (/^MISSED/.test(cell.textContent)) cell.className = 'bad';
  }
  [...head.cells].forEach((cell, k) => {
    cell.tabIndex = 0;
    const sort = () => {
      const down = cell.getAttribute('aria-sort') === 'ascending';
      for (const other of head.cells) other.removeAttribute('aria-sort');
      cell.setAttribute('aria-sort', down ? 'descending' : 'ascending');
      const key = row => row.cells[k]?.textContent.trim() ?? '';
      // Cells without a number are last in both directions.
      const order = (a, b) => {
        const x = numberIn(key(a)), y = numberIn(key(b));
        if (Number.isNaN(x) !== Number.isNaN(y)) return Number.isNaN(x) ? 1 : -1;
        const by = Number.isNaN(x) ? key(a).localeCompare(key(b)) : x - y;
        return down ? -by : by;
      };
      body.append(...rows.sort(order));
    };
    cell.onclick = sort;
    cell.onkeydown = event => { if (event.key === 'Enter') sort(); };
  });
}

// Parts of which one is shown at a time.
const parts = [...document.querySelectorAll('section[data-choice]')];
if (parts.length > 1) {
  const choice = document.createElement('select');
  for (const part of parts) choice.append(new Option(part.dataset.choice));
  const show = () => parts.forEach((part, k) => { part.hidden = k !== choice.selectedIndex; });
  choice.onchange = show; parts[0].before(choice); show();
}

const element = (parent, name, attributes, text) => {
  const made = document.createElementNS(parent.namespaceURI, name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  if (text !== undefined) made.textContent = text;
  parent.append(made);
  return made;
};
const ticks = (low, high) => {
  const raw = (high - low) / 6, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map(k => k * power).find(s => s >= raw);
  const all = [];
  for (let k = Math.ceil(low / step); k * step <= high; ++k) all.push(k * step);
  return all;
};
const short = value => +value.toPrecision(6) === 0 ? '0' : Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3 ? value.toExponential(0) : String(+value.toPrecision(6));
for (const box of document.querySelectorAll('.plot')) {
  const data = JSON.parse(box.querySelector('script').textContent);
  const W = 560, H = 300, L = 62, R = 10, T = 8, B = 40;
  const scaled = data.log_y ? Math.log10 : v => v;
  for (const curve of data.curves) curve.v = curve.y.map(v => v === null || (data.log_y && v <= 0) ? NaN : scaled(v));
  const range = pick => {
    let low = Infinity, high = -Infinity;
    for (const curve of data.curves) for (const v of pick(curve)) if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
    if (!(low < high)) { low -= 1; high += 1; }
    return [low, high];
  };
  const full = () => {
    const [x0, x1] = range(c => c.x), [y0, y1] = range(c => c.v), margin = 0.05 * (y1 - y0);
    return { x0, x1, y0: y0 - margin, y1: y1 + margin };
  };
  let view = full();
  box.insertAdjacentHTML('beforeend', `<svg viewBox="0 0 ${W} ${H}" role="img"></svg>`);
  const svg = box.querySelector('svg');
  const line = document.createElement('p');
  box.append(line);
  const px = x => L + (x - view.x0) / (view.x1 - view.x0) * (W - L - R), py = y => H - B - (y - view.y0) / (view.y1 - view.y0) * (H - B - T);
  const legend = () => { line.innerHTML = ''; for (const c of data.curves) { const s = document.createElement('span'); s.style.color = c.colour; s.textContent = '\u25cf ' + c.name + '   '; line.append(s); } };
  const draw = () => {
    svg.replaceChildren();
    for (const x of ticks(view.x0, view.x1)) {
      element(svg, 'line', { class: 'axis', x1: px(x), x2: px(x), y1: T, y2: H - B });
      element(svg, 'text', { x: px(x), y: H - B + 15, 'text-anchor': 'middle' }, short(x));
    }
    for (const y of ticks(view.y0, view.y1)) {
      if (data.log_y && y !== Math.round(y) && view.y1 - view.y0 > 2) continue;
      element(svg, 'line', { class: 'axis', x1: L, x2: W - R, y1: py(y), y2: py(y) });
      element(svg, 'text', { x: L - 5, y: py(y) + 4, 'text-anchor': 'end' }, short(data.log_y ? 10 ** y : y));
    }
    element(svg, 'text', { x: (L + W - R) / 2, y: H - 6, 'text-anchor': 'middle' }, data.x_label);
    element(svg, 'text', { transform: `translate(13 ${(H - B + T) / 2}) rotate(-90)`, 'text-anchor': 'middle' }, data.y_label);
    let free = 0;  // right of the last text
    for (const mark of data.marks ?? []) {
      if (mark.x < view.x0 || mark.x > view.x1) continue;
      element(svg, 'line', { x1: px(mark.x), x2: px(mark.x), y1: T, y2: H - B, stroke: 'var(--dim)', 'stroke-dasharray': '3 3' });
      if (px(mark.x) < free) continue;
      element(svg, 'text', { x: px(mark.x) + 3, y: T + 11 }, mark.text);
      free = px(mark.x) + 24;
    }
    const inside = element(svg, 'svg', { x: L, y: T, width: W - L - R, height: H - B - T, viewBox: `${L} ${T} ${W - L - R} ${H - B - T}` });
    for (const curve of data.curves) {
      let path = '', pen = false;
      curve.x.forEach((x, i) => {
        const v = curve.v[i];
        if (!Number.isFinite(v)) { pen = false; return; }
        const at = px(x).toFixed(1) + ' ' + py(v).toFixed(1);
        path += curve.dots ? `M${at}h0` : (pen ? 'L' : 'M') + at;
        pen = true;
      });
      element(inside, 'path', { d: path, fill: 'none', stroke: curve.colour, 'stroke-width': curve.dots ? 3 : 1.5, 'stroke-linecap': 'round' });
    }
  };
  const at = event => {
    const r = svg.getBoundingClientRect(), sx = (event.clientX - r.left) / r.width * W, sy = (event.clientY - r.top) / r.height * H;
    return { x: view.x0 + (sx - L) / (W - L - R) * (view.x1 - view.x0), y: view.y0 + (H - B - sy) / (H - B - T) * (view.y1 - view.y0) };
  };
  svg.addEventListener('wheel', event => {
    event.preventDefault();
    const p = at(event), k = event.deltaY > 0 ? 1.25 : 0.8;
    view.x0 = p.x + (view.x0 - p.x) * k; view.x1 = p.x + (view.x1 - p.x) * k;
    if (!event.shiftKey) { view.y0 = p.y + (view.y0 - p.y) * k; view.y1 = p.y + (view.y1 - p.y) * k; }
    draw();
  }, { passive: false });
  let held = null;
  svg.addEventListener('pointerdown', event => { held = at(event); svg.setPointerCapture(event.pointerId); });
  svg.addEventListener('pointermove', event => {
    const p = at(event);
    if (held) { view.x0 += held.x - p.x; view.x1 += held.x - p.x; view.y0 += held.y - p.y; view.y1 += held.y - p.y; draw(); return; }
    const values = data.curves.map(c => {
      let best = -1;
      c.x.forEach((x, i) => { if (best < 0 || Math.abs(x - p.x) < Math.abs(c.x[best] - p.x)) best = i; });
      return best < 0 || c.y[best] === null ? '' : `${c.name} ${+c.y[best].toPrecision(4)}`;
    });
    line.textContent = `${data.x_label} ${+p.x.toPrecision(5)}: ` + values.filter(Boolean).join(', ');
  });
  for (const kind of ['pointerup', 'pointercancel']) svg.addEventListener(kind, () => { held = null; });
  svg.addEventListener('pointerleave', legend);
  svg.addEventListener('dblclick', () => { view = full(); draw(); });
  legend(); draw();
}

const dialog = document.querySelector('dialog'), large = dialog.querySelector('img');
let scale = 1, x = 0, y = 0;
const place = () => { large.style.transform = `translate(${x}px, ${y}px) scale(${scale})`; };
const fit = () => {
  scale = Math.min(innerWidth / large.naturalWidth, innerHeight / large.naturalHeight);
  x = (innerWidth - scale * large.naturalWidth) / 2; y = (innerHeight - scale * large.naturalHeight) / 2;
  place();
};
const zoom = (factor, px, py) => { x = px - (px - x) * factor; y = py - (py - y) * factor; scale *= factor; place(); };
for (const image of document.querySelectorAll('figure img')) image.onclick = () => {
  large.src = image.src; dialog.showModal(); large.decode().then(fit, fit);
};
dialog.addEventListener('wheel', event => { event.preventDefault(); zoom(event.deltaY > 0 ? 0.8 : 1.25, event.clientX, event.clientY); }, { passive: false });
const fingers = new Map();
dialog.addEventListener('pointerdown', event => { fingers.set(event.pointerId, event); dialog.moved = false; dialog.setPointerCapture(event.pointerId); });
dialog.addEventListener('pointermove', event => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  const other = [...fingers.values()].find(f => f.pointerId !== event.pointerId);
  if (Math.hypot(event.clientX - before.clientX, event.clientY - before.clientY) > 2) dialog.moved = true;
  if (other) {
    const length = f => Math.hypot(f.clientX - other.clientX, f.clientY - other.clientY);
    zoom(length(event) / Math.max(1, length(before)), other.clientX, other.clientY);
  } else { x += event.clientX - before.clientX; y += event.clientY - before.clientY; place(); }
  fingers.set(event.pointerId, event);
});
for (const kind of ['pointerup', 'pointercancel']) dialog.addEventListener(kind, event => fingers.delete(event.pointerId));
dialog.addEventListener('click', () => { if (!dialog.moved) dialog.close(); });
dialog.addEventListener('dblclick', fit);
)";

std::string base64(const std::string& bytes) {
  const char* const digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned v = 0;
    for (std::size_t k = 0; k < 3; ++k)
      v = v << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) out += i + k > bytes.size() ? '=' : digits[v >> (18 - 6 * k) & 63u];
  }
  return out;
}

bool begins(const std::string& text, std::string_view with) {
  return text.compare(0, with.size(), with) == 0;
}

/// Replaces text between two equal marks by an HTML element.
std::string marked(std::string text, const std::string& mark, const std::string& element) {
  for (std::size_t at = 0; (at = text.find(mark, at)) != std::string::npos;) {
    const std::size_t end = text.find(mark, at + mark.size());
    if (end == std::string::npos) break;
    const std::string inside = text.substr(at + mark.size(), end - at - mark.size());
    const std::string whole = "<" + element + ">" + inside + "</" + element + ">";
    text.replace(at, end + mark.size() - at, whole);
    at += whole.size();
  }
  return text;
}

std::string inlineHtml(const std::string& text) {
  return marked(marked(escapedHtml(text), "`", "code"), "**", "b");
}

std::vector<std::string> cellsOf(const std::string& row) {
  std::vector<std::string> cells;
  for (std::size_t at = row.find('|'); at != std::string::npos;) {
    const std::size_t end = row.find('|', at + 1);
    if (end == std::string::npos) break;
    std::size_t first = at + 1, last = end;
    while (first < last && row[first] == ' ') ++first;
    while (last > first && row[last - 1] == ' ') --last;
    cells.push_back(row.substr(first, last - first));
    at = end;
  }
  return cells;
}

bool underlines(const std::string& row) {
  return begins(row, "|") && row.find_first_not_of("|-: ") == std::string::npos;
}

void putTable(std::ostream& out, const std::vector<std::string>& rows) {
  out << "<table>";
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (underlines(rows[k])) continue;
    out << "<tr>";
    for (const std::string& cell : cellsOf(rows[k])) out << (k == 0 ? "<th>" : "<td>") << inlineHtml(cell);
    out << "</tr>\n";
  }
  out << "</table>\n";
}

void putList(std::ostream& out, const std::vector<std::string>& lines) {
  out << "<ul>";
  for (const std::string& line : lines) out << "<li>" << inlineHtml(line.substr(2)) << "</li>\n";
  out << "</ul>\n";
}

}  // namespace

std::string escapedHtml(const std::string& text) {
  std::string out;
  out.reserve(text.size());
  for (const char c : text) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

ReportPage::ReportPage(const std::string& title) : title_(title) {
}

void ReportPage::picture(const std::string& file, const std::string& caption) {
  const std::string text = escapedHtml(caption);
  body_ << "<figure><img alt=\"" << text << "\" src=\"data:image/png;base64," << base64(readText(file))
        << "\"><figcaption>" << text << "</figcaption></figure>\n";
}

void ReportPage::plot(const PagePlot& plot) {
  using Json = nlohmann::ordered_json;
  const auto numbers = [](const std::vector<double>& values) {
    constexpr double DIGITS = 1e6;  // of a picture
    Json list = Json::array();
    for (const double v : values) {
      const double scale = v == 0.0 ? 1.0 : DIGITS / std::pow(10.0, std::floor(std::log10(std::abs(v))));
      list.push_back(std::isfinite(v) ? Json(std::round(v * scale) / scale) : Json(nullptr));
    }
    return list;
  };
  Json data = {{"x_label", plot.x_label}, {"y_label", plot.y_label}, {"log_y", plot.log_y}};
  data["curves"] = Json::array();
  for (const PagePlot::Curve& curve : plot.curves) {
    data["curves"].push_back({{"name", curve.name},
                              {"colour", curve.colour},
                              {"dots", curve.is_dots},
                              {"x", numbers(curve.x)},
                              {"y", numbers(curve.y)}});
  }
  for (const PagePlot::Mark& mark : plot.marks) data["marks"].push_back({{"x", mark.x}, {"text", mark.text}});
  // Within a script element only "</" ends it.
  std::string json = data.dump();
  for (std::size_t k = 0; (k = json.find("</", k)) != std::string::npos; k += 3) json.replace(k, 2, "<\\/");
  body_ << "<div class=\"plot\"><h3>" << escapedHtml(plot.title) << "</h3><script type=\"application/json\">"
        << json << "</script></div>\n";
}

void ReportPage::markdown(const std::string& text, const std::string& folder) {
  std::istringstream in(text);
  std::vector<std::string> block;
  const auto close = [&] {
    if (block.empty()) return;
    if (begins(block.front(), "|")) {
      putTable(body_, block);
    } else if (begins(block.front(), "- ")) {
      putList(body_, block);
    } else {
      body_ << "<p>";
      for (const std::string& line : block) body_ << inlineHtml(line) << "\n";
      body_ << "</p>\n";
    }
    block.clear();
  };
  const auto kind = [](const std::string& line) {
    return begins(line, "|") ? 1 : begins(line, "- ") ? 2 : 3;
  };
  for (std::string line; std::getline(in, line);) {
    const std::size_t middle = line.find("](");
    if (line.empty()) {
      close();
    } else if (begins(line, "# ")) {
      close();
      title_ = line.substr(2);
    } else if (begins(line, "#")) {
      close();
      body_ << "<h2>" << inlineHtml(line.substr(line.find_first_not_of("# "))) << "</h2>\n";
    } else if (begins(line, "![") && middle != std::string::npos && line.back() == ')') {
      close();
      picture(folder + "/" + line.substr(middle + 2, line.size() - middle - 3), line.substr(2, middle - 2));
    } else {
      if (!block.empty() && kind(block.front()) != kind(line)) close();
      block.push_back(line);
    }
  }
  close();
}

std::string ReportPage::text() const {
  const std::string title = escapedHtml(title_);
  return "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><title>" +
         title + "</title>\n<style>" + STYLE + "</style></head><body>\n<main>\n<h1>" + title + "</h1>\n" +
         body_.str() +
         "</main>\n<button title=\"Light or dark\">&#9680;</button>\n"
         "<dialog><img alt=\"\"><p>wheel or two fingers zoom, drag moves, a click closes</p></dialog>\n"
         "<script>" +
         SCRIPT + "</script></body></html>\n";
}

void ReportPage::write(const std::string& file) const {
  writeText(file, text());
}

}  // namespace smartmill
