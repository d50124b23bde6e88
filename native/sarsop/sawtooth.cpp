#include "sawtooth.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace lcorpp {

namespace {

// The memory of removed points is released if three times their number exceeds that of the other points by more than this.
constexpr std::size_t kCompactionMargin = 96;

// A share of a weight that may be a rounding error.
constexpr double kNegligibleWeight = 1e-12;

}  // namespace

Sawtooth::Sawtooth(const Model& model, std::vector<double> informed, std::size_t groups)
    : model_(model),
      actions_(as_size(model.actions)),
      informed_(std::move(informed)),
      potentials_(model.states),
      sums_(actions_),
      corners_(as_size(model.states)),
      dense_(as_size(model.states), 0.0) {
    for (std::size_t s = 0; s < corners_.size(); ++s) {
        const double* row = informed_.data() + s * actions_;
        corners_[s] = *std::max_element(row, row + actions_);
        for (std::size_t a = 0; a < actions_; ++a) max_abs_value_ = std::max(max_abs_value_, std::abs(row[a]));
    }
    for (std::size_t g = 0; g < groups; ++g) {
        const std::size_t states = g < model.members.size() ? model.members[g].size() : corners_.size();
        points_by_state_.emplace_back(states);
        point_counts_.emplace_back(states, 0);
    }
}

std::size_t Sawtooth::position(Index group, Index state) const {
    const auto s = as_size(state);
    return as_size(group) < model_.members.size() ? as_size(model_.local[s]) : s;
}

double Sawtooth::informed_value(const Index* states, const double* weights, std::size_t n) {
    std::fill(sums_.begin(), sums_.end(), 0.0);
    for (std::size_t i = 0; i < n; ++i) {
        const double* row = informed_.data() + as_size(states[i]) * actions_;
        for (std::size_t a = 0; a < actions_; ++a) sums_[a] += weights[i] * row[a];
    }
    return *std::max_element(sums_.begin(), sums_.end());
}

double Sawtooth::informed_value(const Weights& belief, Index action) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < belief.size(); ++i) {
        sum += belief.weight[i] * informed_[as_size(belief.state[i]) * actions_ + as_size(action)];
    }
    return sum;
}

// bound = min(informed bound, corners.b + lowest), with lowest = min over the points of phi * excess, at most 0, and
// phi = min over the support of p of b(s) / p(s). Each point is listed at the rarest state of its support, so a loop over
// the states of b meets every point with phi > 0 once. `threshold` is the phi below which a point cannot lower the bound.
double Sawtooth::bound(const Index* states, const double* weights, std::size_t n, Index group, Stamp since) {
    const double initial = initial_bound(states, weights, n, group);
    if (renamings_) {
        renamed_.state.assign(states, states + n);
        renamed_.weight.assign(weights, weights + n);
        renamings_->normalise(renamed_);
        states = renamed_.state.data();
        weights = renamed_.weight.data();
        group = group_of(renamed_.state[0], group);
    }
    double plane = 0.0, mass = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        mass += weights[i];
        plane += weights[i] * corners_[as_size(states[i])];
        dense_[as_size(states[i])] = weights[i];
    }
    const auto& points_by_state = points_by_state_[as_size(group)];
    double lowest = 0.0, share = 0.0;
    const Point* nearest = nullptr;
    std::uint64_t visited = n * actions_;
    for (std::size_t i = 0; i < n; ++i) {
        const auto& numbers = points_by_state[position(group, states[i])];
        for (auto number = numbers.rbegin(); number != numbers.rend(); ++number) {  // the newest first
            const Point& point = points_[as_size(*number)];
            if (point.stamp < since) break;
            ++visited;
            if (point.excess * mass >= lowest) continue;  // phi is at most the mass
            const double threshold = lowest / point.excess;
            double phi = std::numeric_limits<double>::infinity();
            std::size_t entry = point.begin;
            for (; entry != point.end; ++entry) {
                const double ratio = dense_[as_size(states_[entry])] * inverse_weights_[entry];
                if (ratio <= threshold) break;
                if (ratio < phi) phi = ratio;
            }
            visited += 1 + entry - point.begin;
            if (entry == point.end) {
                lowest = phi * point.excess;
                nearest = &point;
                share = phi;
            }
        }
    }
    work_ += visited;
    double bound = std::min(initial, plane + lowest);
    if (nearest && has_potentials(group)) bound = std::min(bound, bound_by_remainder(*nearest, share, states, weights, n, group));
    for (std::size_t i = 0; i < n; ++i) dense_[as_size(states[i])] = 0.0;
    return bound;
}

// A value is convex, so that at b = phi p + r it is at most phi v + the bound at the remainder r. `dense_` is b.
double Sawtooth::bound_by_remainder(const Point& point, double phi, const Index* states, const double* weights, std::size_t n, Index group) {
    for (std::size_t entry = point.begin; entry != point.end; ++entry) {
        dense_[as_size(states_[entry])] -= phi / inverse_weights_[entry];
    }
    rest_states_.clear();
    rest_.clear();
    double lost = 0.0;  // the weights that are too small to be more than rounding errors
    for (std::size_t i = 0; i < n; ++i) {
        const double left = dense_[as_size(states[i])];
        if (left > kNegligibleWeight * weights[i]) {
            rest_states_.push_back(states[i]);
            rest_.push_back(left);
        } else {
            lost += weights[i] * kNegligibleWeight;
        }
    }
    double value = phi * point.value + lost * max_abs_value_;
    if (!rest_.empty()) value += initial_bound(rest_states_.data(), rest_.data(), rest_.size(), group);
    return value;
}

// The potentials hold within a block only.
double Sawtooth::initial_bound(const Index* states, const double* weights, std::size_t n, Index group) {
    const double informed = informed_value(states, weights, n);
    return has_potentials(group) ? std::min(informed, potentials_.bound(states, weights, n, group)) : informed;
}

// Sort the entries of a point, the rarest states first: they exclude a point soonest.
void Sawtooth::sort_entries(const Point& point) {
    const auto& counts = point_counts_[as_size(point.group)];
    sorted_.clear();
    for (std::size_t i = point.begin; i < point.end; ++i) sorted_.emplace_back(states_[i], inverse_weights_[i]);
    std::sort(sorted_.begin(), sorted_.end(), [&](const auto& a, const auto& b) {
        const Index count_a = counts[position(point.group, a.first)], count_b = counts[position(point.group, b.first)];
        return count_a != count_b ? count_a < count_b : a.second < b.second;
    });
    for (std::size_t i = 0; i < sorted_.size(); ++i) {
        states_[point.begin + i] = sorted_[i].first;
        inverse_weights_[point.begin + i] = sorted_[i].second;
    }
}

void Sawtooth::set_renamings(Renamings* renamings) {
    renamings_ = renamings;
    Weights belief;
    for (Point& point : points_) {
        std::vector<std::pair<Index, double>> entries;
        for (std::size_t i = point.begin; i < point.end; ++i) entries.emplace_back(states_[i], inverse_weights_[i]);
        std::sort(entries.begin(), entries.end());
        belief.clear();
        for (const auto& [state, inverse] : entries) {
            belief.state.push_back(state);
            belief.weight.push_back(1.0 / inverse);
        }
        renamings_->normalise(belief);
        for (std::size_t i = 0; i < belief.size(); ++i) {
            states_[point.begin + i] = belief.state[i];
            inverse_weights_[point.begin + i] = 1.0 / belief.weight[i];
        }
        point.group = group_of(belief.state[0], point.group);
        if (!point.removed) point.excess = excess(point);
    }
    release_removed();
    ++next_stamp_;
}

// The group of a belief in normal form, from that of the belief: symmetries rename blocks into blocks.
Index Sawtooth::group_of(Index state, Index group) const {
    return as_size(group) < model_.members.size() ? model_.block[as_size(state)] : group;
}

Stamp Sawtooth::add(const Weights& given, Index group, double value) {
    Weights belief = given;
    if (renamings_) {
        renamings_->normalise(belief);
        group = group_of(belief.state[0], group);
    }
    if (belief.size() == 1) {
        value /= belief.weight[0];
        double& corner = corners_[as_size(belief.state[0])];
        if (value < corner) {
            corner = value;
            for (Point& point : points_) {
                if (!point.removed) point.excess = excess(point);
            }
            ++next_stamp_;  // bounds computed earlier may be lower now
        }
        return -1;
    }
    Point point{next_stamp_++, value, 0.0, states_.size(), states_.size() + belief.size(), group, false};
    for (std::size_t i = 0; i < belief.size(); ++i) {
        states_.push_back(belief.state[i]);
        inverse_weights_.push_back(1.0 / std::max(belief.weight[i], kMinProbability));
        ++point_counts_[as_size(group)][position(group, belief.state[i])];
    }
    sort_entries(point);
    point.excess = excess(point);
    points_.push_back(point);
    index_point(points_.size() - 1);
    ++count_;
    return point.stamp;
}

void Sawtooth::remove(Stamp stamp) {
    const auto point = std::lower_bound(points_.begin(), points_.end(), stamp,
                                        [](const Point& other, Stamp wanted) { return other.stamp < wanted; });
    if (point == points_.end() || point->stamp != stamp || point->removed) return;
    point->removed = true;
    point->excess = 0.0;
    ++removed_;
    --count_;
}

void Sawtooth::compact() {
    if (3 * removed_ > count_ + kCompactionMargin) release_removed();
}

void Sawtooth::drop_older_half() {
    std::size_t dropped = 0;
    const std::size_t half = count_ / 2;
    for (std::size_t i = 0; dropped < half; ++i) {
        if (points_[i].removed) continue;
        remove(points_[i].stamp);
        ++dropped;
    }
    release_removed();
    states_.shrink_to_fit();
    inverse_weights_.shrink_to_fit();
}

void Sawtooth::release_removed() {
    std::size_t kept = 0, written = 0;
    for (auto& group : points_by_state_) {
        for (auto& numbers : group) numbers.clear();
    }
    for (auto& counts : point_counts_) std::fill(counts.begin(), counts.end(), 0);
    for (Point& point : points_) {
        if (point.removed) continue;
        const std::size_t begin = written;
        for (std::size_t i = point.begin; i < point.end; ++i, ++written) {
            states_[written] = states_[i];
            inverse_weights_[written] = inverse_weights_[i];
            ++point_counts_[as_size(point.group)][position(point.group, states_[i])];
        }
        point.begin = begin;
        point.end = written;
        points_[kept++] = point;
    }
    points_.resize(kept);
    states_.resize(written);
    inverse_weights_.resize(written);
    for (std::size_t i = 0; i < kept; ++i) index_point(i);
    removed_ = 0;
}

double Sawtooth::excess(const Point& point) const {
    double plane = 0.0;
    for (std::size_t i = point.begin; i < point.end; ++i) {
        plane += corners_[as_size(states_[i])] / inverse_weights_[i];
    }
    return std::min(0.0, point.value - plane);
}

void Sawtooth::index_point(std::size_t number) {
    const Point& point = points_[number];
    const Index state = states_[point.begin];  // the rarest
    points_by_state_[as_size(point.group)][position(point.group, state)].push_back(static_cast<Index>(number));
}

}  // namespace lcorpp
