#include "bounds.hpp"

#include <algorithm>
#include <cmath>

namespace lcorpp {

// Let F be a monotone operator that shifts by gamma c if its argument shifts by c (all three operators below). Its fixed
// point lies between F(v) + gamma / (1 - gamma) times the minimum and the maximum of the change F(v) - v. Every sweep
// therefore ends with a shift: if all values change by similar amounts, as under slow discounts, few sweeps suffice.
// Source: MacQueen, "A modified dynamic programming method for Markovian decision problems", 1966.

std::vector<double> blind_policies(const Model& model, double tolerance, Clock& clock) {
    const auto S = static_cast<std::size_t>(model.states);
    const SparseTables& T = model.transition;
    std::vector<double> table;
    for (Index a = 0; a < model.actions; ++a) {
        const double* reward = model.reward.data() + static_cast<std::size_t>(a) * S;
        std::vector<double> value(S, *std::min_element(reward, reward + S) / (1 - model.discount)), next(S);
        while (true) {
            double min_change = INFINITY, max_change = -INFINITY;
            for (Index s = 0; s < model.states; ++s) {
                double sum = 0.0;
                for (std::size_t i = T.begin(a, s); i < T.end(a, s); ++i) {
                    sum += T.value[i] * value[static_cast<std::size_t>(T.column[i])];
                }
                const auto row = static_cast<std::size_t>(s);
                next[row] = reward[row] + model.discount * sum;
                min_change = std::min(min_change, next[row] - value[row]);
                max_change = std::max(max_change, next[row] - value[row]);
            }
            value.swap(next);
            const double shift = model.discount / (1 - model.discount) * std::max(0.0, min_change);
            for (double& v : value) v += shift;
            if ((max_change - std::max(0.0, min_change)) * model.discount / (1 - model.discount) <= tolerance || clock.expired()) break;
        }
        table.insert(table.end(), value.begin(), value.end());
    }
    return table;
}

std::vector<double> mdp_bound(const Model& model, double tolerance, Clock& clock) {
    const auto S = static_cast<std::size_t>(model.states), A = static_cast<std::size_t>(model.actions);
    const SparseTables& T = model.transition;
    const double top = *std::max_element(model.reward.begin(), model.reward.end()) / (1 - model.discount);
    std::vector<double> value(S, top), Q(A * S);
    while (true) {
        double min_change = INFINITY, max_change = -INFINITY;
        std::vector<double> next(S, -INFINITY);
        for (Index a = 0; a < model.actions; ++a) {
            for (Index s = 0; s < model.states; ++s) {
                double sum = 0.0;
                for (std::size_t i = T.begin(a, s); i < T.end(a, s); ++i) {
                    sum += T.value[i] * value[static_cast<std::size_t>(T.column[i])];
                }
                const double q = model.reward_of(a, s) + model.discount * sum;
                Q[static_cast<std::size_t>(a) * S + static_cast<std::size_t>(s)] = q;
                next[static_cast<std::size_t>(s)] = std::max(next[static_cast<std::size_t>(s)], q);
            }
        }
        for (std::size_t s = 0; s < S; ++s) {
            min_change = std::min(min_change, value[s] - next[s]);
            max_change = std::max(max_change, value[s] - next[s]);
        }
        const double shift = model.discount / (1 - model.discount) * std::max(0.0, min_change);
        for (std::size_t s = 0; s < S; ++s) value[s] = next[s] - shift;
        if ((max_change - std::max(0.0, min_change)) * model.discount / (1 - model.discount) <= tolerance || clock.expired()) {
            for (double& q : Q) q -= shift;
            return Q;
        }
    }
}

std::vector<double> fast_informed_bound(const Model& model, std::vector<double> Q, double tolerance, Clock& clock) {
    const auto S = static_cast<std::size_t>(model.states), A = static_cast<std::size_t>(model.actions);
    const SparseTables& T = model.transition;
    const SparseTables& Z = model.observation;
    std::vector<double> transposed(S * A), lowered(A * S);  // transposed: (S, A), so that actions are contiguous
    std::vector<double> sums;
    std::vector<Index> slot(static_cast<std::size_t>(model.observations), -1), seen;
    while (!clock.expired()) {
        for (std::size_t a = 0; a < A; ++a) {
            for (std::size_t s = 0; s < S; ++s) transposed[s * A + a] = Q[a * S + s];
        }
        double min_change = INFINITY, max_change = -INFINITY;
        for (Index a = 0; a < model.actions; ++a) {
            for (Index s = 0; s < model.states; ++s) {
                seen.clear();
                sums.clear();
                for (std::size_t i = T.begin(a, s); i < T.end(a, s); ++i) {
                    const Index next_state = T.column[i];
                    const double* values = transposed.data() + static_cast<std::size_t>(next_state) * A;
                    for (std::size_t j = Z.begin(a, next_state); j < Z.end(a, next_state); ++j) {
                        Index& own = slot[static_cast<std::size_t>(Z.column[j])];
                        if (own < 0) {
                            own = static_cast<Index>(seen.size());
                            seen.push_back(Z.column[j]);
                            sums.resize(sums.size() + A, 0.0);
                        }
                        double* sum = sums.data() + static_cast<std::size_t>(own) * A;
                        const double weight = T.value[i] * Z.value[j];
                        for (std::size_t b = 0; b < A; ++b) sum[b] += weight * values[b];
                    }
                }
                double total = 0.0;
                for (std::size_t k = 0; k < seen.size(); ++k) {
                    total += *std::max_element(sums.begin() + static_cast<std::ptrdiff_t>(k * A),
                                               sums.begin() + static_cast<std::ptrdiff_t>((k + 1) * A));
                    slot[static_cast<std::size_t>(seen[k])] = -1;
                }
                const std::size_t at = static_cast<std::size_t>(a) * S + static_cast<std::size_t>(s);
                lowered[at] = model.reward_of(a, s) + model.discount * total;
                min_change = std::min(min_change, Q[at] - lowered[at]);
                max_change = std::max(max_change, Q[at] - lowered[at]);
            }
        }
        const double shift = model.discount / (1 - model.discount) * std::max(0.0, min_change);
        for (std::size_t i = 0; i < Q.size(); ++i) Q[i] = std::min(Q[i], lowered[i] - shift);
        if ((max_change - std::max(0.0, min_change)) * model.discount / (1 - model.discount) <= tolerance) break;
    }
    return Q;
}

}  // namespace lcorpp
