#include "forward_backward.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lcorpp {

void ForwardBackward::weigh_next(const Steps& steps, std::size_t t) {
    const auto [K, A, O, V, start, transition, observation, reward] = tables_;
    const bool ends = steps.ended && t + 1 == steps.count;
    const double* rows = observation + steps.actions[t] * (K + 1) * O + steps.observations[t];
    for (std::size_t s = 0; s < K; ++s) after_[s] = ends ? 0.0 : rows[s * O];
    after_[K] = ends ? rows[K * O] : 0.0;
}

double ForwardBackward::filter(const Steps& steps) {
    const auto [K, A, O, V, start, transition, observation, reward] = tables_;
    forward_.assign((steps.count + 1) * (K + 1), 0.0);
    scales_.resize(steps.count);
    for (std::size_t s = 0; s < K; ++s) forward_[s] = start[s] * (steps.evidence ? steps.evidence[s] : 1.0);
    double log_likelihood = 0.0;
    for (std::size_t t = 0; t < steps.count; ++t) {
        const double* before = &forward_[t * (K + 1)];
        double* next = &forward_[(t + 1) * (K + 1)];
        const double* rows = transition + steps.actions[t] * K * (K + 1);
        const double* earned = reward + steps.actions[t] * K * V + steps.rewards[t];
        weigh_next(steps, t);
        for (std::size_t s = 0; s < K; ++s) {
            const double weight = before[s] * earned[s * V];
            if (weight == 0.0) continue;
            for (std::size_t n = 0; n <= K; ++n) next[n] += weight * rows[s * (K + 1) + n];
        }
        double sum = 0.0;
        for (std::size_t n = 0; n <= K; ++n) sum += next[n] *= after_[n];
        if (!(sum > 0.0)) return -std::numeric_limits<double>::infinity();
        for (std::size_t n = 0; n <= K; ++n) next[n] /= sum;
        scales_[t] = sum;
        log_likelihood += std::log(sum);
    }
    return log_likelihood;
}

double ForwardBackward::add(const Steps& steps, Counts& counts) {
    const auto [K, A, O, V, start, transition, observation, reward] = tables_;
    const double log_likelihood = filter(steps);
    if (!std::isfinite(log_likelihood)) return log_likelihood;
    std::fill(backward_.begin(), backward_.end(), 1.0);
    for (std::size_t t = steps.count; t-- > 0;) {
        const std::size_t a = steps.actions[t], o = steps.observations[t], r = steps.rewards[t];
        const double* before = &forward_[t * (K + 1)];
        const double* rows = transition + a * K * (K + 1);
        weigh_next(steps, t);
        for (std::size_t n = 0; n <= K; ++n) after_[n] *= backward_[n] / scales_[t];
        for (std::size_t s = 0; s < K; ++s) {
            const double earned = reward[(a * K + s) * V + r], weight = before[s] * earned;
            double later = 0.0;
            for (std::size_t n = 0; n <= K; ++n) {
                const double part = rows[s * (K + 1) + n] * after_[n];
                later += part;
                counts.transition[(a * K + s) * (K + 1) + n] += weight * part;
                counts.observation[(a * (K + 1) + n) * O + o] += weight * part;
            }
            counts.reward[(a * K + s) * V + r] += weight * later;
            if (t == 0) counts.start[s] += weight * later;
            earlier_[s] = earned * later;
        }
        std::copy(earlier_.begin(), earlier_.end(), backward_.begin());
        backward_[K] = 0.0;
    }
    return log_likelihood;
}

// Return an index by its weight. random: uniform from 0 to 1.
static std::size_t draw(const std::vector<double>& weights, double random) {
    double sum = 0.0, below = 0.0;
    for (const double weight : weights) sum += weight;
    std::size_t last = 0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
        if (weights[i] == 0.0) continue;
        last = i;
        below += weights[i];
        if (random * sum < below) return i;
    }
    return last;
}

double ForwardBackward::sample(const Steps& steps, const double* random, Counts& counts) {
    const auto [K, A, O, V, start, transition, observation, reward] = tables_;
    const double log_likelihood = filter(steps);
    if (!std::isfinite(log_likelihood)) return log_likelihood;
    const double* last = &forward_[steps.count * (K + 1)];
    after_.assign(last, last + K + 1);
    std::size_t next = draw(after_, random[steps.count]);
    for (std::size_t t = steps.count; t-- > 0;) {
        const std::size_t a = steps.actions[t], o = steps.observations[t], r = steps.rewards[t];
        for (std::size_t s = 0; s < K; ++s) {
            earlier_[s] = forward_[t * (K + 1) + s] * reward[(a * K + s) * V + r] * transition[(a * K + s) * (K + 1) + next];
        }
        const std::size_t state = draw(earlier_, random[t]);
        counts.transition[(a * K + state) * (K + 1) + next] += 1.0;
        counts.observation[(a * (K + 1) + next) * O + o] += 1.0;
        counts.reward[(a * K + state) * V + r] += 1.0;
        next = state;
    }
    counts.start[next] += 1.0;
    return log_likelihood;
}

}  // namespace lcorpp
