// COMPRESS: replace the alpha vectors by those of a finite-state controller with fewer plans.
// Sources: Hansen, "Solving POMDPs by searching in policy space", UAI 1998 (controllers and their values); Grzes, Poupart,
// Yang and Hoey, "Energy efficient execution of POMDP policies", IEEE Transactions on Cybernetics 2015 (controllers made
// of alpha vectors).
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "tree.hpp"

namespace lcorpp {

// Each vector is the value of a plan: an action, then the vector of the observation. The pruned vectors that others depend
// on are mostly older versions of plans that the sets contain in a better version. The controller replaces such a version
// by the vector that is best for the states in which the roots' plans reach it. As plans may then lead back to themselves,
// all values are computed anew.
class Controller {
  public:
    Controller(Tree& tree, Clock& clock);

    // Replace pruned vectors by vectors of the sets, where these are no worse for the plans of the roots.
    void replace_pruned(const std::vector<Index>& roots);

    // Compute the values of the plans, with at most about `max_evaluations` vectors. Returns by how much they may exceed
    // those of the controller, infinity if time is up.
    double evaluate(double max_evaluations);

    // The value at a node if all values are lowered by `excess`.
    double value(const Node& node, double excess) const;

    // Replace the vectors of the tree, lowered by `excess`.
    void install(double excess);

  private:
    struct Plan {
        Stamp stamp;
        Index group, action;
        Index row;                                  // in its set, -1 for a pruned vector
        const PrunedVector* pruned;                 // null for a vector of a set
        std::vector<std::pair<Index, Index>> next;  // observation and plan; none for a blind policy
        std::vector<float> arriving;                // discounted visits of each state that are not passed on yet
        std::vector<float> occupancy;               // all of them, of a pruned vector
        std::vector<double> values;                 // over the states of the group
        std::size_t evaluated = 0, changed = 0;     // number of the last evaluation, and of the last change
    };

    bool is_blind(Stamp vector) const { return vector < tree_.model.actions; }
    Index find_plan(Stamp vector, Index group);
    void find_occupancy(const std::vector<Index>& roots);
    void pass_on(Plan& plan);
    Index find_replacement(Index number);
    std::vector<double> back_up(const Plan& plan);

    Tree& tree_;
    Clock& clock_;
    std::vector<Plan> plans_;  // by falling stamps; blind policies that others lead to are at the end
    std::map<std::pair<Stamp, Index>, Index> number_of_;  // of the plan with a stamp and a group
    std::vector<Index> next_plan_;                        // (O) reusable memory
};

}  // namespace lcorpp
