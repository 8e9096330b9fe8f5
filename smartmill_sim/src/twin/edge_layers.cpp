#include "smartmill_sim/twin/edge_layers.h"

#include <algorithm>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_sim/twin/tool_contact.h"

namespace smartmill::sim {
namespace {

constexpr double GONE = 1e-3;  // [m] radius reduction of a missing edge, more than any feed

std::vector<double> radiiOf(const EdgeLayer& layer, std::vector<double> radius) {
  if (layer.missing_tooth >= 0) radius.at(static_cast<std::size_t>(layer.missing_tooth)) -= GONE;
  return radius;
}

double depthOf(const EdgeLayer& layer, double depth) {
  return std::max(layer.from_surface ? depth - layer.height : std::min(layer.height, depth), SMALLEST_DEPTH);
}

std::vector<ContactArc> arcsOf(const EdgeLayer& layer, std::vector<ContactArc> arcs) {
  for (ContactArc& arc : arcs) arc.depth = std::max(depthOf(layer, arc.depth), arc.bottom + SMALLEST_DEPTH);
  return arcs;
}

CuttingLaw lawOf(const EdgeLayer& layer, CuttingLaw law) {
  if (layer.share == EdgeLayer::Share::all) return law;
  CuttingCoefficients& k = law.coefficients;
  if (layer.share == EdgeLayer::Share::chip) k.kte = k.kre = k.kae = 0.0;
  if (layer.share == EdgeLayer::Share::edge) k.ktc = k.krc = k.kac = 0.0;
  law.damping = 0.0;
  return law;
}

}  // namespace

EdgeLayers::EdgeLayers(const TwinSetup& setup, const CuttingLaw& law, double time_step, bool rigid) {
  if (setup.layers.empty()) return;
  ToolGeometry tool = *setup.model.tool;
  tool.edge = {};
  for (const EdgeLayer& definition : setup.layers) {
    if (definition.weight == 0.0) continue;
    std::vector<double> radius = radiiOf(definition, setup.radius_offset);
    Layer layer{definition, {}, {}};
    // Tables do not separate the teeth.
    if (rigid && definition.only_tooth < 0) {
      layer.rigid.emplace(tool, lawOf(definition, law), std::move(radius), setup.path_share);
    } else {
      layer.process.emplace(tool, lawOf(definition, law), time_step, std::move(radius), setup.path_share);
      if (definition.only_tooth >= 0) layer.process->selectTooth(definition.only_tooth);
    }
    layers_.push_back(std::move(layer));
  }
}

void EdgeLayers::engage(const std::vector<ContactArc>& arcs, const ToolMotion& now) {
  for (Layer& layer : layers_) {
    const std::vector<ContactArc> adapted = arcsOf(layer.definition, arcs);
    if (layer.rigid) layer.rigid->engage(adapted, feedOf(now));
    if (layer.process) layer.process->engage(adapted, now);
  }
}

void EdgeLayers::setDepths(const std::vector<ContactArc>& arcs) {
  for (Layer& layer : layers_) {
    std::vector<double> adapted;
    for (const ContactArc& arc : arcsOf(layer.definition, arcs)) adapted.push_back(arc.depth);
    if (layer.rigid) layer.rigid->setDepths(adapted);
    if (layer.process) layer.process->setDepths(adapted);
  }
}

void EdgeLayers::setLaw(const CuttingLaw& law) {
  for (Layer& layer : layers_) {
    if (layer.rigid) layer.rigid->setLaw(lawOf(layer.definition, law));
    if (layer.process) layer.process->setLaw(lawOf(layer.definition, law));
  }
}

void EdgeLayers::setRadii(const std::vector<double>& radius_offset) {
  for (Layer& layer : layers_) {
    if (!layer.process) throw Error("cutting: radii that change, expected none with tables");
    layer.process->setRadii(radiiOf(layer.definition, radius_offset));
  }
}

void EdgeLayers::add(const ToolMotion& now, CuttingForce& sum) {
  for (Layer& layer : layers_) {
    sum.add(layer.rigid ? layer.rigid->at(now.angle) : layer.process->step(now), layer.definition.weight);
  }
}

void EdgeLayers::endStep(const std::array<double, 2>& displacement) {
  for (Layer& layer : layers_) {
    if (layer.process) layer.process->endStep(displacement);
  }
}

}  // namespace smartmill::sim
