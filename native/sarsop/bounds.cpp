#include "bounds.hpp"

#include <algorithm>
#include <cmath>

namespace lcorpp {

// An operator F that is monotone and shifts by gamma c when its argument shifts by c (all three below) has its
// fixed point between F(v) + gamma / (1 - gamma) times the least and the largest change F(v) - v. So a sweep
// ends with a shift: where all values change alike, as they do under slow discounts, few sweeps are enough.
// Source: MacQueen, "A modified dynamic programming method for Markovian decision problems", 1966.

std::vector<double> blind_policies(const Model& model, double tolerance, Clock& clock) {
    const auto S = static_cast<std::size_t>(model.states);
    const Rows& T = model.transition;
    std::vector<double> all;
    for (Index a = 0; a < model.actions; ++a) {
        const double* reward = model.reward.data() + static_cast<std::size_t>(a) * S;
        std::vector<double> value(S, *std::min_element(reward, reward + S) / (1 - model.discount)), next(S);
        while (true) {
            double least = INFINITY, most = -INFINITY;
            for (Index s = 0; s < model.states; ++s) {
                double sum = 0.0;
                for (std::size_t i = T.begin(a, s); i < T.end(a, s); ++i) {
                    sum += T.value[i] * value[static_cast<std::size_t>(T.column[i])];
                }
                const auto place = static_cast<std::size_t>(s);
                next[place] = reward[place] + model.discount * sum;
                least = std::min(least, next[place] - value[place]);
                most = std::max(most, next[place] - value[place]);
            }
            value.swap(next);
            const double shift = model.discount / (1 - model.discount) * std::max(0.0, least);
            for (double& v : value) v += shift;
            if ((most - std::max(0.0, least)) * model.discount / (1 - model.discount) <= tolerance || clock.over()) break;
        }
        all.insert(all.end(), value.begin(), value.end());
    }
    return all;
}

std::vector<double> mdp_bound(const Model& model, double tolerance, Clock& clock) {
    const auto S = static_cast<std::size_t>(model.states), A = static_cast<std::size_t>(model.actions);
    const Rows& T = model.transition;
    const double top = *std::max_element(model.reward.begin(), model.reward.end()) / (1 - model.discount);
    std::vector<double> value(S, top), Q(A * S);
    while (true) {
        double least = INFINITY, most = -INFINITY;  // how far values fall
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
            least = std::min(least, value[s] - next[s]);
            most = std::max(most, value[s] - next[s]);
        }
        const double shift = model.discount / (1 - model.discount) * std::max(0.0, least);
        for (std::size_t s = 0; s < S; ++s) value[s] = next[s] - shift;
        if ((most - std::max(0.0, least)) * model.discount / (1 - model.discount) <= tolerance || clock.over()) {
            for (double& q : Q) q -= shift;
            return Q;
        }
    }
}

std::vector<double> fast_informed_bound(const Model& model, std::vector<double> Q, double tolerance, Clock& clock) {
    const auto S = static_cast<std::size_t>(model.states), A = static_cast<std::size_t>(model.actions);
    const Rows& T = model.transition;
    const Rows& Z = model.observation;
    std::vector<double> turned(S * A), lowered(A * S);  // turned: state by state, so that actions run together
    std::vector<double> sums;
    std::vector<Index> place(static_cast<std::size_t>(model.observations), -1), seen;
    while (!clock.over()) {
        for (std::size_t a = 0; a < A; ++a) {
            for (std::size_t s = 0; s < S; ++s) turned[s * A + a] = Q[a * S + s];
        }
        double least = INFINITY, most = -INFINITY;
        for (Index a = 0; a < model.actions; ++a) {
            for (Index s = 0; s < model.states; ++s) {
                seen.clear();
                sums.clear();
                for (std::size_t i = T.begin(a, s); i < T.end(a, s); ++i) {
                    const Index reached = T.column[i];
                    const double* worth = turned.data() + static_cast<std::size_t>(reached) * A;
                    for (std::size_t j = Z.begin(a, reached); j < Z.end(a, reached); ++j) {
                        Index& own = place[static_cast<std::size_t>(Z.column[j])];
                        if (own < 0) {
                            own = static_cast<Index>(seen.size());
                            seen.push_back(Z.column[j]);
                            sums.resize(sums.size() + A, 0.0);
                        }
                        double* sum = sums.data() + static_cast<std::size_t>(own) * A;
                        const double weight = T.value[i] * Z.value[j];
                        for (std::size_t b = 0; b < A; ++b) sum[b] += weight * worth[b];
                    }
                }
                double total = 0.0;
                for (std::size_t k = 0; k < seen.size(); ++k) {
                    total += *std::max_element(sums.begin() + static_cast<std::ptrdiff_t>(k * A),
                                               sums.begin() + static_cast<std::ptrdiff_t>((k + 1) * A));
                    place[static_cast<std::size_t>(seen[k])] = -1;
                }
                const std::size_t at = static_cast<std::size_t>(a) * S + static_cast<std::size_t>(s);
                lowered[at] = model.reward_of(a, s) + model.discount * total;
                least = std::min(least, Q[at] - lowered[at]);
                most = std::max(most, Q[at] - lowered[at]);
            }
        }
        const double shift = model.discount / (1 - model.discount) * std::max(0.0, least);
        for (std::size_t i = 0; i < Q.size(); ++i) Q[i] = std::min(Q[i], lowered[i] - shift);
        if ((most - std::max(0.0, least)) * model.discount / (1 - model.discount) <= tolerance) break;
    }
    return Q;
}

}  // namespace lcorpp
