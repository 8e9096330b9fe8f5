#include "smartmill_loadmeter/inspection/inspection_file.h"

#include "smartmill_core/error.h"
#include "smartmill_core/io/inspection_file.h"

namespace smartmill::loadmeter {

std::vector<InspectedFeature> readInspection(const std::string& file,
                                             const InspectionParameters& parameters) {
  const InspectionFile read = readInspectionFile(file);
  std::vector<InspectedFeature> features;
  for (const InspectionFile::Dimension& dimension : read.features) {
    const InspectionFile::Cut& stated = read.cuts.at(dimension.feature.condition);
    InspectedCut cut;
    cut.condition = stated.condition;
    cut.edge_age = stated.edge_age;
    try {
      features.push_back({recordOf(dimension.feature, cut, parameters), cut.condition});
    } catch (const Error& error) {
      throw Error(file + ": " + dimension.path + ": " + error.what());
    }
  }
  return features;
}

}  // namespace smartmill::loadmeter
