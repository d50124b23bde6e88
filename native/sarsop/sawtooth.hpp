// The upper bound: the fast informed bound and the sawtooth interpolation of points.
// Source: Hauskrecht, JAIR 2000, section 4.4; Smith and Simmons, UAI 2005, section 4.2.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "model.hpp"
#include "graph/renamings.hpp"
#include "potentials/potentials.hpp"

namespace lcorpp {

// An upper bound on the value, positively homogeneous: arguments are beliefs times a probability.
//
// bound(b) = min(max over a of Q(a).b, corners.b + min over the points (p, v) of phi(b, p) (v - corners.p)), with
// phi(b, p) = min over the support of p of b(s) / p(s), which is 0 if b does not contain the support of p. The excess of a
// point is v - corners.p. The corners are the bounds at the corners of the belief simplex.
// A point counts only at beliefs of its own group.
class Sawtooth {
  public:
    // informed: (S, A) Q values that are upper bounds, by state. groups: number of groups.
    Sawtooth(const Model& model, std::vector<double> informed, std::size_t groups);

    // Take the points as those of all beliefs that symmetries of the model rename into theirs.
    void set_renamings(Renamings* renamings);

    // Add a bound at all beliefs within blocks.
    void add_potential(Potential potential) {
        potentials_.add(std::move(potential));
        ++next_stamp_;  // bounds computed earlier may be lower now
    }

    Stamp next_stamp() const { return next_stamp_; }
    std::size_t count() const { return count_; }
    std::uint64_t work() const { return work_; }
    std::size_t entry_count() const { return states_.size(); }

    // Memory of all points in bytes.
    std::size_t memory_size() const {
        return points_.capacity() * (sizeof(Point) + sizeof(Index)) + states_.capacity() * (sizeof(Index) + sizeof(double));
    }

    // The fast informed bound alone, at n states with weights.
    double informed_value(const Index* states, const double* weights, std::size_t n);
    // The informed Q value of one action.
    double informed_value(const Weights& belief, Index action) const;

    // The bound without any points.
    double initial_bound(const Index* states, const double* weights, std::size_t n, Index group);

    // The bound at n states with weights, using the points of a group whose stamp is at least `since`.
    double bound(const Index* states, const double* weights, std::size_t n, Index group, Stamp since);

    // Lower the bound at a belief. Returns the stamp of the new point, -1 if the belief is a corner.
    Stamp add(const Weights& belief, Index group, double value);

    // Call f(states, 1 / p(states), value, group) for every point.
    template <typename F>
    void for_each_point(F f) const {
        std::vector<Index> states;
        std::vector<double> inverses;
        for (const Point& point : points_) {
            if (point.removed) continue;
            states.clear();
            inverses.clear();
            for (std::size_t i = point.begin; i < point.end; ++i) {
                states.push_back(states_[i]);
                inverses.push_back(inverse_weights_[i]);
            }
            f(states, inverses, point.value, point.group);
        }
    }
    // (S) the bound at each corner of the belief simplex, where the state is known.
    const std::vector<double>& corners() const { return corners_; }

    // Remove a point that a newer one at the same belief has replaced.
    void remove(Stamp stamp);

    // Release the memory of removed points if there are many.
    void compact();

    // Remove the older half of the points: those that no backup has lowered for the longest time.
    void drop_older_half();

  private:
    struct Point {
        Stamp stamp;
        double value, excess;    // excess: value - corners.p, at most 0
        std::size_t begin, end;  // range of its entries
        Index group;
        bool removed;
    };
    bool has_potentials(Index group) const { return !potentials_.empty() && as_size(group) < model_.members.size(); }
    Index group_of(Index state, Index group) const;
    double bound_by_remainder(const Point& point, double phi, const Index* states, const double* weights, std::size_t n, Index group);
    void release_removed();
    double excess(const Point& point) const;
    void sort_entries(const Point& point);
    void index_point(std::size_t number);
    std::size_t position(Index group, Index state) const;

    const Model& model_;
    const std::size_t actions_;
    double max_abs_value_ = 0.0;  // of the informed bound
    std::vector<double> informed_;  // (S, A)
    Potentials potentials_;
    Renamings* renamings_ = nullptr;
    Weights renamed_;                  // reusable memory
    std::vector<double> rest_;         // reusable memory
    std::vector<Index> rest_states_;   // reusable memory
    std::vector<double> sums_;      // (A) reusable memory
    std::vector<double> corners_;   // (S)
    std::vector<Point> points_;  // by rising stamp
    std::vector<Index> states_;            // (entries) of all points
    std::vector<double> inverse_weights_;  // (entries) 1 / p(s)
    // Points by group and position of the rarest state of their support: only points whose rarest state has weight
    // can count at a belief.
    std::vector<std::vector<std::vector<Index>>> points_by_state_;
    std::vector<std::vector<Index>> point_counts_;  // by group and position: number of points with that state
    std::vector<double> dense_;                     // (S) reusable memory, zero between calls
    std::vector<std::pair<Index, double>> sorted_;  // reusable memory
    Stamp next_stamp_ = 0;
    std::size_t count_ = 0, removed_ = 0;
    std::uint64_t work_ = 0;
};

}  // namespace lcorpp
