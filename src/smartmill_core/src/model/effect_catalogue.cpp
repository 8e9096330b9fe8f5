#include "smartmill_core/model/effect_catalogue.h"

#include <algorithm>
#include <tuple>

#include "model/effect_files.h"

namespace smartmill {

namespace {

std::vector<EffectKind> inOrderOfAction(bool empirical) {
  std::vector<EffectKind> kinds = effects::fromFiles();
  kinds.erase(std::remove_if(kinds.begin(), kinds.end(),
                             [&](const EffectKind& kind) { return kind.empirical() != empirical; }),
              kinds.end());
  std::sort(kinds.begin(), kinds.end(), [](const EffectKind& a, const EffectKind& b) {
    return std::tie(a.stage, a.rank, a.name) < std::tie(b.stage, b.rank, b.name);
  });
  return kinds;
}

const EffectKind* findIn(const std::vector<EffectKind>& kinds, const std::string& name) {
  const auto found =
      std::find_if(kinds.begin(), kinds.end(), [&](const EffectKind& kind) { return kind.name == name; });
  return found == kinds.end() ? nullptr : &*found;
}

}  // namespace

const std::vector<EffectKind>& effectCatalogue() {
  static const std::vector<EffectKind> CATALOGUE = inOrderOfAction(false);
  return CATALOGUE;
}

const std::vector<EffectKind>& empiricalCatalogue() {
  static const std::vector<EffectKind> CATALOGUE = inOrderOfAction(true);
  return CATALOGUE;
}

const EffectKind* findEffect(const std::string& name) {
  const EffectKind* kind = findIn(effectCatalogue(), name);
  return kind ? kind : findIn(empiricalCatalogue(), name);
}

const EffectKind* findEmpirical(const std::string& stage, const std::string& form) {
  for (const EffectKind& kind : empiricalCatalogue()) {
    if (kind.form_stage == stage && kind.form == form) return &kind;
  }
  return nullptr;
}

}  // namespace smartmill
