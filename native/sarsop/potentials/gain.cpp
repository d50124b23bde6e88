#include "potentials/gain.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model.hpp"

namespace lcorpp {

namespace {

// Iterations, and the weight that each state keeps meanwhile.
constexpr int kMaxAscents = 300;
constexpr double kLeastWeight = 1e-9;

// Largest number of halvings of a step, its growth after a success, and the largest exponent of a factor.
constexpr int kHalvings = 40;
constexpr double kGrowth = 1.6, kMaxExponent = 40.0;

// The function that `maximise_gain` maximises, and its gradient.
class Gain {
  public:
    Gain(const std::vector<double>& linear, double entropy, double gamma, const std::vector<double>& likelihood, std::size_t m,
         const std::vector<Potential::Pair>& pairs)
        : linear_(linear), entropy_(entropy), gamma_(m > 0 ? gamma : 0.0), likelihood_(likelihood), m_(m), pairs_(pairs), logs_(m), roots_(linear.size()) {}

    // The value at b; fills the gradient if it is not null. The function is homogeneous, so that value = gradient.b.
    double compute(const std::vector<double>& b, std::vector<double>& gradient) {
        const std::size_t n = b.size();
        gradient = linear_;
        if (entropy_ > 0) {
            std::fill(logs_.begin(), logs_.end(), 0.0);
            for (std::size_t s = 0; s < n; ++s) {
                for (std::size_t o = 0; o < m_; ++o) logs_[o] += b[s] * likelihood_[s * m_ + o];
            }
            for (double& mass : logs_) mass = std::log(std::max(mass, kMinProbability));
            for (std::size_t s = 0; s < n; ++s) {
                const double own = std::log(b[s]);
                double next = 0.0;  // derivative of sum over o of P(o) H(b after o)
                for (std::size_t o = 0; o < m_; ++o) {
                    const double p = likelihood_[s * m_ + o];
                    if (p > 0) next -= p * (own + std::log(p) - logs_[o]);
                }
                gradient[s] += entropy_ * (-own - gamma_ * next);
            }
        }
        for (std::size_t s = 0; s < n; ++s) roots_[s] = std::sqrt(b[s]);
        for (const Potential::Pair& pair : pairs_) {
            const double first = roots_[as_size(pair.first)], second = roots_[as_size(pair.second)];
            gradient[as_size(pair.first)] += 0.5 * pair.weight * second / first;
            gradient[as_size(pair.second)] += 0.5 * pair.weight * first / second;
        }
        double value = 0.0;
        for (std::size_t s = 0; s < n; ++s) value += gradient[s] * b[s];
        return value;
    }

  private:
    const std::vector<double>& linear_;
    double entropy_, gamma_;
    const std::vector<double>& likelihood_;
    std::size_t m_;
    const std::vector<Potential::Pair>& pairs_;
    std::vector<double> logs_, roots_;
};

}  // namespace

Ascent maximise_gain(const std::vector<double>& linear, double entropy, double gamma, const std::vector<double>& likelihood, std::size_t m,
                     const std::vector<Potential::Pair>& pairs, double tolerance, std::vector<double>& b) {
    Gain gain(linear, entropy, gamma, likelihood, m, pairs);
    const std::size_t n = linear.size();
    const auto scale = [&](std::vector<double>& weights) {
        double total = 0.0;
        for (double& weight : weights) total += weight = std::max(weight, kLeastWeight);
        for (double& weight : weights) weight /= total;
    };
    scale(b);
    std::vector<double> gradient, next(n), next_gradient;
    double value = gain.compute(b, gradient), step = 1.0 / std::max(entropy, 1.0);
    double upper = std::numeric_limits<double>::infinity();
    for (int iteration = 0; iteration < kMaxAscents; ++iteration) {
        const double largest = *std::max_element(gradient.begin(), gradient.end());
        upper = std::min(upper, largest);  // by concavity and homogeneity
        if (upper - value <= tolerance) break;
        bool is_higher = false;
        for (int halving = 0; halving < kHalvings && !is_higher; ++halving) {
            for (std::size_t s = 0; s < n; ++s) next[s] = b[s] * std::exp(std::max(-kMaxExponent, step * (gradient[s] - largest)));
            scale(next);
            const double found = gain.compute(next, next_gradient);
            is_higher = found > value;
            if (is_higher) {
                value = found;
                b.swap(next);
                gradient.swap(next_gradient);
                step *= kGrowth;
            } else {
                step *= 0.5;
            }
        }
        if (!is_higher) break;
    }
    return {value, upper};
}

}  // namespace lcorpp
