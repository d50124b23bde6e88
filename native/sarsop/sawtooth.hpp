// The upper bound: the fast informed bound, lowered by points with the sawtooth interpolation.
// Source: Hauskrecht, JAIR 2000, section 4.4; Smith and Simmons, UAI 2005, section 4.2.
#pragma once

#include <vector>

#include "model.hpp"

namespace lcorpp {

// An upper bound on the value, positively homogeneous: it may be asked at beliefs times a probability.
//
// At b it is the least of max over a of Q(a).b and of corners.b + phi(b) (v - corners.p) over the points
// (p, v), phi = min over the support of p of b(s) / p(s); phi is 0 where p's support is not inside b's.
class Sawtooth {
  public:
    // informed: (S, A) Q values above the truth, state by state. groups: how many sets of points there are;
    // a point is found only by those who ask for its group.
    Sawtooth(const Model& model, std::vector<double> informed, std::size_t groups);

    Stamp next_stamp() const { return next_; }
    std::size_t count() const { return count_; }

    // The value at n states with weights of the informed bound alone.
    double informed(const Index* states, const double* weights, std::size_t n) const;
    // That of one action.
    double informed(const Weights& belief, Index action) const;

    // The bound there, using the points of a group whose stamp is at least `since`.
    double bound(const Index* states, const double* weights, std::size_t n, Index group, Stamp since);

    // Lower the bound at a belief; the stamp of the new point, -1 where a corner took it.
    Stamp add(const Weights& belief, Index group, double value);

    // Call f(states, 1 / p(states), n, value, group) for every point.
    template <typename F>
    void each(F f) const {
        std::vector<Index> states;
        std::vector<double> inverses;
        for (const Point& point : points_) {
            if (point.retired) continue;
            states.clear();
            inverses.clear();
            for (std::size_t i = point.begin; i < point.end; ++i) {
                states.push_back(entries_[i].state);
                inverses.push_back(entries_[i].inverse);
            }
            f(states, inverses, point.value, point.group);
        }
    }
    const std::vector<double>& corners() const { return corners_; }

    // A point that another at the same belief has replaced.
    void retire(Stamp stamp);

    // Forget the points that were retired, if they are many.
    void compact();

  private:
    struct Point {
        Stamp stamp;
        double value, excess;
        std::size_t begin, end;  // where its entries are
        Index group;
        bool retired;
    };
    struct Entry {
        Index state;
        double inverse;  // 1 / p(s)
    };

    double excess(const Point& point) const;
    void index(std::size_t number);

    const Model& model_;
    const std::size_t actions_;
    std::vector<double> informed_;
    std::vector<double> corners_;
    std::vector<Point> points_;   // by rising stamp
    std::vector<Entry> entries_;
    // For each group and state the points filed under it: each point under one state of its support, so that
    // only those need be looked at whose state has weight.
    std::vector<std::vector<std::vector<Index>>> filed_;
    std::vector<std::vector<Index>> having_;  // for each group and state how many points have it
    std::vector<double> dense_;               // (S) scratch, zero between calls
    Stamp next_ = 0;
    std::size_t count_ = 0, retired_ = 0;

    std::size_t place(Index group, Index state) const;
};

}  // namespace lcorpp
