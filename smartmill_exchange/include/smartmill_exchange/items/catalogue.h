#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_exchange/items/data_item.h"

namespace smartmill::exchange {

/// All data items, in the order of their indices.
const std::vector<DataItem>& catalogue();

/// Index of an item. @throws std::out_of_range if there is none
std::size_t indexOf(const std::string& id);

const char* nameOf(Category category);  ///< SAMPLE, EVENT, CONDITION

/// The document with its table of items replaced by that of the catalogue, between the lines `<!-- items -->`
/// and
/// `<!-- /items -->`. @throws Error when the lines are missing
std::string withItemTable(const std::string& document);

}  // namespace smartmill::exchange
