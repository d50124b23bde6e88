#include "potentials/potentials.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lcorpp {

double Potentials::bound(const Index* states, const double* weights, std::size_t n, Index block) {
    double lowest = std::numeric_limits<double>::infinity();
    if (potentials_.empty()) return lowest;
    logs_.resize(n);
    double mass = 0.0, top = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < n; ++i) {
        logs_[i] = std::log(weights[i]);
        mass += weights[i];
        top = std::max(top, logs_[i]);
        roots_[as_size(states[i])] = std::sqrt(weights[i]);
    }
    double entropy = mass * std::log(mass);
    for (std::size_t i = 0; i < n; ++i) entropy -= weights[i] * logs_[i];
    for (const Potential& potential : potentials_) {
        if (potential.block >= 0 && potential.block != block) continue;
        double value = -potential.entropy * entropy;
        for (std::size_t i = 0; i < n; ++i) value += weights[i] * potential.offset[as_size(states[i])];
        if (potential.scale > 0) {
            double sum = 0.0;
            for (std::size_t i = 0; i < n; ++i) sum += std::exp(potential.power * (logs_[i] - top));
            value += potential.scale * std::exp(top + std::log(sum) / potential.power);
        }
        for (const Potential::Pair& pair : potential.pairs) {
            value -= pair.weight * roots_[as_size(pair.first)] * roots_[as_size(pair.second)];
        }
        lowest = std::min(lowest, value);
    }
    for (std::size_t i = 0; i < n; ++i) roots_[as_size(states[i])] = 0.0;
    return lowest;
}

}  // namespace lcorpp
