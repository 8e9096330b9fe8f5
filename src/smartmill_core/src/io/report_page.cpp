#include "smartmill_core/io/report_page.h"

#include <string_view>
#include <vector>

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
@media print { button { display: none; } .table { overflow: visible; } }
)";

constexpr const char* SCRIPT = R"(
const root = document.documentElement;
const setTheme = theme => { root.dataset.theme = theme; };
setTheme(matchMedia('(prefers-color-scheme: light)').matches ? 'light' : 'dark');
document.querySelector('button').onclick = () => setTheme(root.dataset.theme === 'dark' ? 'light' : 'dark');

const numberIn = text => { const found = text.match(/^[^\d\-+.]*([-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?)/i); return found ? +found[1] : NaN; };
for (const table of document.querySelectorAll('table')) {
  const [head, ...rows] = table.rows, body = rows[0]?.parentNode;
  const box = document.createElement('div');
  box.className = 'table'; table.replaceWith(box); box.append(table);
  for (const row of rows) for (const cell of row.cells) {
    if (/^[-+<>=\d.e %]+$/.test(cell.textContent) && /\d/.test(cell.textContent)) cell.className = 'number';
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
  for (const char c : text)
    out += c == '<'   ? "&lt;"
           : c == '>' ? "&gt;"
           : c == '&' ? "&amp;"
           : c == '"' ? "&quot;"
                      : std::string(1, c);
  return out;
}

ReportPage::ReportPage(const std::string& title) : title_(title) {
}

void ReportPage::picture(const std::string& file, const std::string& caption) {
  const std::string text = escapedHtml(caption);
  body_ << "<figure><img alt=\"" << text << "\" src=\"data:image/png;base64," << base64(readText(file))
        << "\"><figcaption>" << text << "</figcaption></figure>\n";
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
