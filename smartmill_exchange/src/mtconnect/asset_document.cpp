#include "smartmill_exchange/mtconnect/asset_document.h"

#include <cmath>

#include "smartmill_core/io/report_page.h"
#include "smartmill_exchange/items/observation.h"

namespace smartmill::exchange {
namespace {

std::string elementOf(const std::string& label) {
  std::string name = label;
  name.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(name.front())));
  return name;
}

void add(const std::vector<Quantity>& quantities, const std::string& indent, std::string* xml) {
  for (const Quantity& q : quantities) {
    if (!std::isfinite(q.value)) continue;
    *xml += indent + "<s:Quantity name=\"" + xmlText(q.name) + "\" units=\"" + xmlText(q.unit) + "\"";
    if (std::isfinite(q.std_dev)) *xml += " standardDeviation=\"" + numberText(q.std_dev) + "\"";
    *xml += ">" + numberText(q.value) + "</s:Quantity>\n";
  }
}

}  // namespace

std::string xmlText(const std::string& text) {
  std::string plain = text;
  for (char& c : plain)
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  return escapedHtml(plain);
}

std::string assetXml(const Asset& asset, const std::string& device_uuid) {
  const std::string element = "s:" + asset.type;
  std::string xml = "<" + element + " xmlns:s=\"" + EXTENSION + "\" assetId=\"" + xmlText(asset.id) +
                    "\" timestamp=\"" + timeText(asset.time) + "\" deviceUuid=\"" + xmlText(device_uuid) +
                    "\">\n";
  for (const auto& [label, text] : asset.labels) {
    const std::string name = "s:" + elementOf(label);
    xml += "  <" + name + ">" + xmlText(text) + "</" + name + ">\n";
  }
  add(asset.quantities, "  ", &xml);
  for (const QuantityGroup& group : asset.groups) {
    xml += "  <s:Group name=\"" + xmlText(group.name) + "\">\n";
    add(group.quantities, "    ", &xml);
    xml += "  </s:Group>\n";
  }
  return xml + "</" + element + ">";
}

}  // namespace smartmill::exchange
