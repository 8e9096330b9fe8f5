// Burzoni: force sensors in the spindle; data shared by his figures.

#include "gallery/spindle_sensor.h"

#include <map>
#include <utility>

#include "smartmill_core/model/machine_model.h"

namespace smartmill::studies {

const kalman::BurzoniData& burzoniData(unsigned seed) {
  static std::map<unsigned, kalman::BurzoniData> gathered;
  auto at = gathered.find(seed);
  if (at == gathered.end())
    at = gathered.emplace(seed, kalman::gatherBurzoni(readMachineModel(GALLERY_MODEL), seed, BURZONI_BAND))
             .first;
  return at->second;
}

const kalman::BurzoniTable& burzoniTableOf(unsigned seed, std::size_t number) {
  static std::map<std::pair<unsigned, std::size_t>, kalman::BurzoniTable> made;
  auto at = made.find({seed, number});
  if (at == made.end())
    at = made.emplace(std::pair(seed, number), kalman::burzoniTable(burzoniData(seed), number, BURZONI_BAND))
             .first;
  return at->second;
}

std::vector<Figure> spindleSensorFigures() {
  std::vector<Figure> all;
  for (const auto& some :
       {sensorStaticFigures(), sensorPlantFigures(), sensorTableFigures(), sensorCutFigures()})
    all.insert(all.end(), some.begin(), some.end());
  return all;
}

}  // namespace smartmill::studies
