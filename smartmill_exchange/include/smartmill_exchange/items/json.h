#pragma once

#include <string>

#include "smartmill_exchange/items/asset.h"
#include "smartmill_exchange/items/observation.h"

namespace smartmill::exchange {

/// JSON of one observation: id, time, value (number, text, object of numbers, list of activations; null:
/// unavailable), units.
std::string observationJson(const Observation& observation);

/// JSON of an asset: id, type, time, labels, quantities, groups.
std::string assetJson(const Asset& asset);

/// JSON of the catalogue: a list of items with category, type, units, meaning, uncertainty, bandwidth, topic.
std::string catalogueJson();

/// JSON schema (draft 7) of observationJson().
std::string observationSchema();

}  // namespace smartmill::exchange
