#include "sawtooth.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace lcorpp {

Sawtooth::Sawtooth(const Model& model, std::vector<double> informed, std::size_t groups)
    : model_(model),
      actions_(static_cast<std::size_t>(model.actions)),
      informed_(std::move(informed)),
      corners_(static_cast<std::size_t>(model.states)),
      dense_(static_cast<std::size_t>(model.states), 0.0) {
    for (std::size_t s = 0; s < corners_.size(); ++s) {
        const double* row = informed_.data() + s * actions_;
        corners_[s] = *std::max_element(row, row + actions_);
    }
    for (std::size_t g = 0; g < groups; ++g) {
        const std::size_t states = g < model.members.size() ? model.members[g].size() : corners_.size();
        filed_.emplace_back(states);
        having_.emplace_back(states, 0);
    }
}

// The last group is that of beliefs over several blocks, where every state has its own place.
std::size_t Sawtooth::place(Index group, Index state) const {
    const auto s = static_cast<std::size_t>(state);
    return static_cast<std::size_t>(group) < model_.members.size() ? static_cast<std::size_t>(model_.local[s]) : s;
}

double Sawtooth::informed(const Index* states, const double* weights, std::size_t n) const {
    double best = -std::numeric_limits<double>::infinity();
    for (std::size_t a = 0; a < actions_; ++a) {
        double sum = 0.0;
        for (std::size_t i = 0; i < n; ++i) sum += weights[i] * informed_[static_cast<std::size_t>(states[i]) * actions_ + a];
        best = std::max(best, sum);
    }
    return best;
}

double Sawtooth::informed(const Weights& belief, Index action) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < belief.size(); ++i) {
        sum += belief.weight[i] *
               informed_[static_cast<std::size_t>(belief.state[i]) * actions_ + static_cast<std::size_t>(action)];
    }
    return sum;
}

double Sawtooth::bound(const Index* states, const double* weights, std::size_t n, Index group, Stamp since) {
    double plane = 0.0, mass = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        mass += weights[i];
        plane += weights[i] * corners_[static_cast<std::size_t>(states[i])];
        dense_[static_cast<std::size_t>(states[i])] = weights[i];
    }
    const auto& filed = filed_[static_cast<std::size_t>(group)];
    double lowest = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        const auto& numbers = filed[place(group, states[i])];
        for (auto number = numbers.rbegin(); number != numbers.rend(); ++number) {  // the newest first
            const Point& point = points_[static_cast<std::size_t>(*number)];
            if (point.stamp < since) break;
            if (point.excess * mass >= lowest) continue;  // phi is at most the mass
            const double enough = lowest / point.excess;
            double phi = std::numeric_limits<double>::infinity();
            const Entry* entry = entries_.data() + point.begin;
            const Entry* end = entries_.data() + point.end;
            for (; entry != end; ++entry) {
                const double ratio = dense_[static_cast<std::size_t>(entry->state)] * entry->inverse;
                if (ratio <= enough) break;
                if (ratio < phi) phi = ratio;
            }
            if (entry == end) lowest = phi * point.excess;
        }
    }
    for (std::size_t i = 0; i < n; ++i) dense_[static_cast<std::size_t>(states[i])] = 0.0;
    return std::min(informed(states, weights, n), plane + lowest);
}

Stamp Sawtooth::add(const Weights& belief, Index group, double value) {
    if (belief.size() == 1) {
        value /= belief.weight[0];
        double& corner = corners_[static_cast<std::size_t>(belief.state[0])];
        if (value < corner) {
            corner = value;
            for (Point& point : points_) {
                if (!point.retired) point.excess = excess(point);
            }
            ++next_;  // a bound that was asked before may be lower now
        }
        return -1;
    }
    Point point{next_++, value, 0.0, entries_.size(), entries_.size() + belief.size(), group, false};
    for (std::size_t i = 0; i < belief.size(); ++i) entries_.push_back({belief.state[i], 1.0 / std::max(belief.weight[i], kImpossible)});
    auto& having = having_[static_cast<std::size_t>(group)];
    for (const Index s : belief.state) ++having[place(group, s)];
    // What few points have decides soonest that a belief is no match.
    std::sort(entries_.begin() + static_cast<std::ptrdiff_t>(point.begin), entries_.end(),
              [&](const Entry& a, const Entry& b) {
                  const Index here = having[place(group, a.state)], there = having[place(group, b.state)];
                  return here != there ? here < there : a.inverse < b.inverse;
              });
    point.excess = excess(point);
    points_.push_back(point);
    index(points_.size() - 1);
    ++count_;
    return point.stamp;
}

void Sawtooth::retire(Stamp stamp) {
    const auto found = std::lower_bound(points_.begin(), points_.end(), stamp,
                                        [](const Point& point, Stamp wanted) { return point.stamp < wanted; });
    if (found == points_.end() || found->stamp != stamp || found->retired) return;
    found->retired = true;
    found->excess = 0.0;
    ++retired_;
    --count_;
}

void Sawtooth::compact() {
    if (3 * retired_ <= count_ + 96) return;
    std::vector<Entry> entries;
    std::size_t kept = 0;
    for (auto& group : filed_) {
        for (auto& numbers : group) numbers.clear();
    }
    for (auto& having : having_) std::fill(having.begin(), having.end(), 0);
    for (Point& point : points_) {
        if (point.retired) continue;
        const std::size_t begin = entries.size();
        entries.insert(entries.end(), entries_.begin() + static_cast<std::ptrdiff_t>(point.begin),
                       entries_.begin() + static_cast<std::ptrdiff_t>(point.end));
        point.begin = begin;
        point.end = entries.size();
        for (std::size_t i = begin; i < entries.size(); ++i) {
            ++having_[static_cast<std::size_t>(point.group)][place(point.group, entries[i].state)];
        }
        points_[kept++] = point;
    }
    points_.resize(kept);
    entries_.swap(entries);
    for (std::size_t i = 0; i < kept; ++i) index(i);
    retired_ = 0;
}

double Sawtooth::excess(const Point& point) const {
    double plane = 0.0;
    for (std::size_t i = point.begin; i < point.end; ++i) {
        plane += corners_[static_cast<std::size_t>(entries_[i].state)] / entries_[i].inverse;
    }
    return std::min(0.0, point.value - plane);
}

void Sawtooth::index(std::size_t number) {
    const Point& point = points_[number];
    const Index state = entries_[point.begin].state;  // the rarest
    filed_[static_cast<std::size_t>(point.group)][place(point.group, state)].push_back(static_cast<Index>(number));
}

}  // namespace lcorpp
