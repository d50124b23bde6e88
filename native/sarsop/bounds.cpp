#include "bounds.hpp"

#include <algorithm>
#include <cmath>

namespace lcorpp {

// Let F be a monotone operator that shifts by gamma c if its argument shifts by c (all three operators below). Its fixed
// point lies between F(v) + gamma / (1 - gamma) times the minimum and the maximum of the change F(v) - v. Every sweep
// therefore ends with a shift: if all values change by similar amounts, as under discounts near 1, few sweeps suffice.
// Source: MacQueen, "A modified dynamic programming method for Markovian decision problems", 1966.

namespace {

// The smallest and largest change of a value in a sweep, in the direction in which the bound improves.
struct Change {
    double gamma, smallest = INFINITY, largest = -INFINITY;

    void add(double change) {
        smallest = std::min(smallest, change);
        largest = std::max(largest, change);
    }
    double shift() const { return gamma / (1 - gamma) * std::max(0.0, smallest); }
    bool within(double tolerance) const {
        return (largest - std::max(0.0, smallest)) * gamma / (1 - gamma) <= tolerance;
    }
};

// The reward of an action in a state plus the discounted expectation of the next state's value.
double back_up(const Model& model, Index action, Index state, const std::vector<double>& value) {
    const SparseTables& T = model.transition;
    double sum = 0.0;
    for (std::size_t i = T.begin(action, state); i < T.end(action, state); ++i) sum += T.value[i] * value[as_size(T.column[i])];
    return model.reward_of(action, state) + model.discount * sum;
}

}  // namespace

std::vector<double> blind_policies(const Model& model, double tolerance, Clock& clock) {
    const auto S = as_size(model.states);
    std::vector<double> table;
    for (Index a = 0; a < model.actions; ++a) {
        const double* reward = model.reward.data() + as_size(a) * S;
        std::vector<double> value(S, *std::min_element(reward, reward + S) / (1 - model.discount)), next(S);
        while (true) {
            Change change{model.discount};
            for (Index s = 0; s < model.states; ++s) {
                next[as_size(s)] = back_up(model, a, s, value);
                change.add(next[as_size(s)] - value[as_size(s)]);
            }
            value.swap(next);
            for (double& v : value) v += change.shift();
            if (change.within(tolerance) || clock.expired()) break;
        }
        table.insert(table.end(), value.begin(), value.end());
    }
    return table;
}

std::vector<double> mdp_bound(const Model& model, double tolerance, Clock& clock) {
    const auto S = as_size(model.states);
    const double top = *std::max_element(model.reward.begin(), model.reward.end()) / (1 - model.discount);
    std::vector<double> value(S, top), next(S), Q(as_size(model.actions) * S);
    while (true) {
        Change change{model.discount};
        std::fill(next.begin(), next.end(), -INFINITY);
        for (Index a = 0; a < model.actions; ++a) {
            for (Index s = 0; s < model.states; ++s) {
                const double q = back_up(model, a, s, value);
                Q[as_size(a) * S + as_size(s)] = q;
                next[as_size(s)] = std::max(next[as_size(s)], q);
            }
        }
        for (std::size_t s = 0; s < S; ++s) change.add(value[s] - next[s]);
        for (std::size_t s = 0; s < S; ++s) value[s] = next[s] - change.shift();
        if (change.within(tolerance) || clock.expired()) {
            for (double& q : Q) q -= change.shift();
            return Q;
        }
    }
}

std::vector<double> fast_informed_bound(const Model& model, std::vector<double> Q, double tolerance, Clock& clock) {
    const auto S = as_size(model.states), A = as_size(model.actions);
    const SparseTables& T = model.transition;
    const SparseTables& Z = model.observation;
    std::vector<double> transposed(S * A), lowered(A * S);  // transposed: (S, A), so that actions are contiguous
    std::vector<double> sums;
    std::vector<Index> slot(as_size(model.observations), -1), seen;
    while (!clock.expired()) {
        for (std::size_t a = 0; a < A; ++a) {
            for (std::size_t s = 0; s < S; ++s) transposed[s * A + a] = Q[a * S + s];
        }
        Change change{model.discount};
        for (Index a = 0; a < model.actions; ++a) {
            for (Index s = 0; s < model.states; ++s) {
                seen.clear();
                sums.clear();
                for (std::size_t i = T.begin(a, s); i < T.end(a, s); ++i) {
                    const Index next_state = T.column[i];
                    const double* values = transposed.data() + as_size(next_state) * A;
                    for (std::size_t j = Z.begin(a, next_state); j < Z.end(a, next_state); ++j) {
                        Index& own = slot[as_size(Z.column[j])];
                        if (own < 0) {
                            own = static_cast<Index>(seen.size());
                            seen.push_back(Z.column[j]);
                            sums.resize(sums.size() + A, 0.0);
                        }
                        double* sum = sums.data() + as_size(own) * A;
                        const double weight = T.value[i] * Z.value[j];
                        for (std::size_t b = 0; b < A; ++b) sum[b] += weight * values[b];
                    }
                }
                double total = 0.0;
                for (std::size_t k = 0; k < seen.size(); ++k) {
                    total += *std::max_element(sums.begin() + static_cast<std::ptrdiff_t>(k * A),
                                               sums.begin() + static_cast<std::ptrdiff_t>((k + 1) * A));
                    slot[as_size(seen[k])] = -1;
                }
                const std::size_t at = as_size(a) * S + as_size(s);
                lowered[at] = model.reward_of(a, s) + model.discount * total;
                change.add(Q[at] - lowered[at]);
            }
        }
        for (std::size_t i = 0; i < Q.size(); ++i) Q[i] = std::min(Q[i], lowered[i] - change.shift());
        if (change.within(tolerance)) break;
    }
    return Q;
}

}  // namespace lcorpp
