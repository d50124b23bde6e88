#include "potentials/power_potentials.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace lcorpp {

namespace {

// The candidates for C are these multiples of the smallest loss of a question divided by 1 - gamma, by this factor.
constexpr int kScales = 14;
constexpr double kLargestScale = 4.0, kScaleFactor = 0.7;

// Halvings of the interval of powers, and its ends.
constexpr int kBisections = 14;
constexpr double kMinPower = 1.0 + 1e-4, kMaxPower = 20.0;

// Iterations for the maximum of F, and the weight that each state keeps meanwhile.
constexpr int kMaxIterations = 300;
constexpr double kMinWeight = 1e-9, kStep = 0.9;

// Relative margin for rounding errors.
constexpr double kMargin = 1e-12;

// A question about a block: its loss A(a, s), and the probabilities of the observations (states, observations).
struct Question {
    std::vector<double> loss, likelihood;
    std::size_t observations;
    double min_loss;
};

// An action that is no question on a block: its loss.
struct Move {
    std::vector<double> loss;
};

struct Conditions {
    std::vector<Question> questions;
    std::vector<Move> moves;
    std::vector<double> value;  // (S) of the MDP
    double gamma;
};

Conditions collect(const Model& model, const std::vector<double>& mdp) {
    const auto S = as_size(model.states);
    Conditions conditions;
    conditions.gamma = model.discount;
    std::vector<double>& value = conditions.value;
    value.assign(S, -std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < mdp.size(); ++i) value[i % S] = std::max(value[i % S], mdp[i]);
    const auto loss_of = [&](Index action, Index state) {
        const SparseTables& T = model.transition;
        double sum = 0.0;
        for (std::size_t i = T.begin(action, state); i < T.end(action, state); ++i) sum += T.value[i] * value[as_size(T.column[i])];
        return value[as_size(state)] - model.reward_of(action, state) - model.discount * sum;
    };
    double lowest = 0.0;  // a loss below 0 means that the values are not yet above their backups
    for (Index a = 0; a < model.actions; ++a) {
        for (Index s = 0; s < model.states; ++s) lowest = std::min(lowest, loss_of(a, s));
    }
    for (double& v : value) v -= lowest / (1 - model.discount);
    std::vector<Index> next;
    std::vector<std::size_t> column(as_size(model.observations));
    for (const std::vector<Index>& block : model.members) {
        if (block.size() == 1) continue;  // the bound is W there
        for (Index a = 0; a < model.actions; ++a) {
            std::vector<double> loss;
            next.clear();
            bool is_question = true;
            const SparseTables& T = model.transition;
            const SparseTables& Z = model.observation;
            for (const Index s : block) {
                loss.push_back(std::max(0.0, loss_of(a, s)));
                is_question = is_question && T.end(a, s) - T.begin(a, s) == 1;
                if (is_question) next.push_back(T.column[T.begin(a, s)]);
            }
            if (is_question) {
                std::vector<Index> sorted = next;
                std::sort(sorted.begin(), sorted.end());
                is_question = std::adjacent_find(sorted.begin(), sorted.end()) == sorted.end();
            }
            if (!is_question) {
                conditions.moves.push_back({std::move(loss)});
                continue;
            }
            std::fill(column.begin(), column.end(), 0);
            std::size_t observations = 0;
            for (const Index s : next) {
                for (std::size_t i = Z.begin(a, s); i < Z.end(a, s); ++i) {
                    if (column[as_size(Z.column[i])] == 0) column[as_size(Z.column[i])] = ++observations;
                }
            }
            std::vector<double> likelihood(block.size() * observations, 0.0);
            for (std::size_t k = 0; k < block.size(); ++k) {
                for (std::size_t i = Z.begin(a, next[k]); i < Z.end(a, next[k]); ++i) {
                    likelihood[k * observations + column[as_size(Z.column[i])] - 1] = Z.value[i];
                }
            }
            const double min_loss = *std::min_element(loss.begin(), loss.end());
            conditions.questions.push_back({std::move(loss), std::move(likelihood), observations, min_loss});
        }
    }
    return conditions;
}

// Whether F(w) <= 1 for all w, shown by a gradient.
bool holds(const Question& question, double gamma, double C, double f, double q, std::vector<double>& w) {
    const std::size_t n = question.loss.size(), m = question.observations;
    std::vector<double> powers(n * m), k(n), sums(m), gradient(n);
    for (std::size_t i = 0; i < n * m; ++i) powers[i] = question.likelihood[i] > 0 ? std::pow(question.likelihood[i], q) : 0.0;
    for (std::size_t s = 0; s < n; ++s) k[s] = ((1 - gamma) - question.loss[s] / C) / f;
    // F must be concave. If all k are negative, their terms are at most the largest k, as the sum of w^(1/q) is at least 1.
    const double limit = 1.0 - std::min(0.0, *std::max_element(k.begin(), k.end())) - kMargin;
    for (double& weight : k) weight = std::max(0.0, weight);
    if (w.size() != n) w.assign(n, 1.0 / static_cast<double>(n));
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
        std::fill(sums.begin(), sums.end(), 0.0);
        for (std::size_t s = 0; s < n; ++s) {
            for (std::size_t o = 0; o < m; ++o) sums[o] += w[s] * powers[s * m + o];
        }
        double value = 0.0, mean = 0.0, largest = -std::numeric_limits<double>::infinity();
        for (std::size_t o = 0; o < m; ++o) {
            const double root = std::pow(sums[o], 1 / q);
            value += gamma * root;
            sums[o] = gamma * root / (q * sums[o]);
        }
        for (std::size_t s = 0; s < n; ++s) {
            double slope = 0.0;
            for (std::size_t o = 0; o < m; ++o) slope += sums[o] * powers[s * m + o];
            if (k[s] > 0) {
                const double root = std::pow(w[s], 1 / q);
                value += k[s] * root;
                slope += k[s] * root / (q * w[s]);
            }
            gradient[s] = slope;
            mean += w[s] * slope;
            largest = std::max(largest, slope);
        }
        if (value + largest - mean <= limit) return true;  // F is concave
        if (value > limit) return false;
        double total = 0.0;
        for (std::size_t s = 0; s < n; ++s) {
            w[s] = std::max(kMinWeight, w[s] * std::exp(std::max(-50.0, kStep * q / (q - 1) * (gradient[s] - largest))));
            total += w[s];
        }
        for (double& weight : w) weight /= total;
    }
    return false;
}

// The smallest f for the moves.
double find_factor(const Conditions& conditions, double C, double q) {
    double factor = 1.0;
    const double p = q / (q - 1);
    for (const Move& move : conditions.moves) {
        double sum = 0.0, top = 0.0;
        for (const double loss : move.loss) top = std::max(top, 1 - loss / C);
        if (top <= 0) continue;
        for (const double loss : move.loss) {
            if (loss < C) sum += std::pow((1 - loss / C) / top, p);
        }
        factor = std::max(factor, top * std::pow(sum, 1 / p));
    }
    return factor;
}

}  // namespace

std::vector<Potential> find_power_potentials(const Model& model, const std::vector<double>& mdp, const std::vector<Weights>& beliefs,
                                             Clock& clock) {
    const Conditions conditions = collect(model, mdp);
    double smallest = std::numeric_limits<double>::infinity();
    for (const Question& question : conditions.questions) smallest = std::min(smallest, question.min_loss);
    std::vector<Potential> found;
    if (conditions.questions.empty() || !(smallest > 0)) return found;
    std::vector<std::vector<double>> maxima(conditions.questions.size());
    double C = kLargestScale * smallest / (1 - model.discount);
    for (int number = 0; number < kScales && !clock.expired(); ++number, C *= kScaleFactor) {
        const auto is_valid = [&](double q, double f) {
            for (std::size_t i = 0; i < conditions.questions.size(); ++i) {
                if (clock.expired() || !holds(conditions.questions[i], model.discount, C, f, q, maxima[i])) return false;
            }
            return true;
        };
        double low = kMinPower, high = kMaxPower, factor = find_factor(conditions, C, low);
        if (!is_valid(low, factor)) continue;
        for (int i = 0; i < kBisections; ++i) {
            const double q = 1 + std::sqrt((low - 1) * (high - 1)), f = find_factor(conditions, C, q);
            if (is_valid(q, f)) {
                low = q;
                factor = f;
            } else {
                high = q;
            }
        }
        Potential potential;
        potential.offset = conditions.value;
        for (double& offset : potential.offset) offset -= C;
        potential.scale = factor * C;
        potential.power = low;
        found.push_back(std::move(potential));
    }
    std::vector<char> used(found.size(), 0);
    for (const Weights& belief : beliefs) {
        double best = 0.0;
        for (std::size_t i = 0; i < belief.size(); ++i) best += belief.weight[i] * conditions.value[as_size(belief.state[i])];
        std::size_t chosen = found.size();
        for (std::size_t i = 0; i < found.size(); ++i) {
            Potentials one(model.states);
            one.add(found[i]);
            const double value = one.bound(belief.state.data(), belief.weight.data(), belief.size(), model.block[as_size(belief.state[0])]);
            if (value < best) {
                best = value;
                chosen = i;
            }
        }
        if (chosen < found.size()) used[chosen] = 1;
    }
    std::vector<Potential> result;
    for (std::size_t i = 0; i < found.size(); ++i) {
        if (used[i]) result.push_back(std::move(found[i]));
    }
    return result;
}

}  // namespace lcorpp
