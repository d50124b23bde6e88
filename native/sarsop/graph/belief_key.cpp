#include "graph/belief_key.hpp"

#include <cmath>
#include <limits>

namespace lcorpp {

namespace {

// Constants of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014): the increment, and the first multiplier of its mixing.
constexpr std::uint64_t kGolden = 0x9E3779B97F4A7C15ull, kMultiplier = 0xBF58476D1CE4E5B9ull;

long long rounded(double weight) { return std::llround(weight * kBeliefResolution); }

}  // namespace

std::uint64_t hash_belief(const Index* states, const double* weights, std::size_t n) {
    std::uint64_t hash = kGolden;
    for (std::size_t i = 0; i < n; ++i) {
        const auto weight = static_cast<std::uint64_t>(rounded(weights[i]));
        if (weight == 0) continue;
        for (const std::uint64_t number : {static_cast<std::uint64_t>(states[i]), weight}) {
            hash ^= number + kGolden + (hash << 6) + (hash >> 2);
            hash *= kMultiplier;
            hash ^= hash >> 31;
        }
    }
    return hash;
}

bool same_belief(const Index* states_a, const double* weights_a, std::size_t n_a, const Index* states_b, const double* weights_b,
                 std::size_t n_b) {
    std::size_t i = 0, j = 0;
    while (true) {
        while (i < n_a && rounded(weights_a[i]) == 0) ++i;
        while (j < n_b && rounded(weights_b[j]) == 0) ++j;
        if (i == n_a || j == n_b) return i == n_a && j == n_b;
        if (states_a[i] != states_b[j] || rounded(weights_a[i]) != rounded(weights_b[j])) return false;
        ++i;
        ++j;
    }
}

double l1_distance(const Index* states_a, const double* weights_a, std::size_t n_a, const Index* states_b, const double* weights_b,
                   std::size_t n_b) {
    double sum = 0.0;
    std::size_t i = 0, j = 0;
    while (i < n_a || j < n_b) {
        if (j == n_b || (i < n_a && states_a[i] < states_b[j])) {
            sum += weights_a[i++];
        } else if (i == n_a || states_b[j] < states_a[i]) {
            sum += weights_b[j++];
        } else {
            sum += std::abs(weights_a[i++] - weights_b[j++]);
        }
    }
    return sum;
}

float lipschitz_slack(double max_abs_value, double distance) {
    return std::nextafter(static_cast<float>(max_abs_value * distance), std::numeric_limits<float>::infinity());
}

}  // namespace lcorpp
