// Numbers in text, with the bits that Python's float() gives.
#pragma once

#include <cstddef>
#include <string_view>

namespace lcorpp {

// Parse the number at an offset: digits with an optional sign, point and exponent. Returns the offset after it, npos if
// there is none. The value may be infinite.
std::size_t parse_number(std::string_view text, std::size_t at, double& value);

}  // namespace lcorpp
