#include "number.hpp"

#include <Python.h>

#include <algorithm>
#include <cstdint>
#include <string>

namespace lcorpp {

namespace {

// Powers of ten that doubles represent exactly.
constexpr double kPowers[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                              1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
constexpr int kMaxPower = 22;

// Integers below it have exact doubles, and 19 digits fit into 64 bits.
constexpr std::uint64_t kMaxExact = std::uint64_t{1} << 53;
constexpr int kMaxDigits = 19;

constexpr int kMaxExponent = 100000;  // larger ones are cut: the value is zero or infinite

bool is_digit(std::string_view text, std::size_t at) { return at < text.size() && text[at] >= '0' && text[at] <= '9'; }

}  // namespace

// The quotient or product of two exact doubles is rounded once, so it is the nearest double (Clinger, PLDI 1990); other
// numbers are parsed by Python.
std::size_t parse_number(std::string_view text, std::size_t begin, double& value) {
    std::size_t at = begin;
    const bool negative = at < text.size() && text[at] == '-';
    if (negative || (at < text.size() && text[at] == '+')) ++at;
    std::uint64_t mantissa = 0;
    int digits = 0, exponent = 0;
    bool any = false, point = false;
    for (;; ++at) {
        if (is_digit(text, at)) {
            any = true;
            if (mantissa == 0 && text[at] == '0') {  // a leading zero
                exponent -= point;
                continue;
            }
            if (++digits <= kMaxDigits) mantissa = 10 * mantissa + static_cast<std::uint64_t>(text[at] - '0');
            exponent -= point;
        } else if (at < text.size() && text[at] == '.' && !point) {
            point = true;
        } else {
            break;
        }
    }
    if (!any) return std::string_view::npos;
    if (at < text.size() && (text[at] == 'e' || text[at] == 'E')) {
        std::size_t next = at + 1;
        const bool below = next < text.size() && text[next] == '-';
        if (below || (next < text.size() && text[next] == '+')) ++next;
        if (is_digit(text, next)) {
            int written = 0;
            for (; is_digit(text, next); ++next) written = std::min(10 * written + (text[next] - '0'), kMaxExponent);
            exponent += below ? -written : written;
            at = next;
        }
    }
    if (digits <= kMaxDigits && mantissa < kMaxExact && std::abs(exponent) <= kMaxPower) {
        value = static_cast<double>(mantissa);
        value = exponent < 0 ? value / kPowers[-exponent] : value * kPowers[exponent];
        if (negative) value = -value;
    } else if (mantissa == 0) {
        value = negative ? -0.0 : 0.0;
    } else {
        value = PyOS_string_to_double(std::string(text.substr(begin, at - begin)).c_str(), nullptr, nullptr);
    }
    return at;
}

}  // namespace lcorpp
