// A graph of beliefs with an upper bound at each node: the search that lowers the bound where points generalise little.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "clock.hpp"
#include "model.hpp"
#include "graph/renamings.hpp"

namespace lcorpp {

class Tree;

// Beliefs to which the same answers in another order lead, or that a symmetry renames into each other, are one node. A trial
// costs as much as the beliefs that it adds: bounds by vectors and points are computed at the nodes that it passes, not at all
// children of these as in `Tree`. Its lower bounds only direct the search: no vector earns them.
// Source: Smith and Simmons, "Point-based POMDP algorithms: Improved analysis and implementation", UAI 2005 (trials);
// Ross and others, JAIR 2008 (bounds of nodes).
class BeliefGraph {
  public:
    BeliefGraph(Tree& tree, Renamings renamings);

    std::size_t memory_size() const;
    std::uint64_t work() const { return work_; }
    Renamings& renamings() { return renamings_; }

    // Remove all nodes.
    void clear();

    // Lower the upper bound at a belief by trials, each of which aims at a share of the gap there, until the gap is at most
    // `min_target`, some work has been done (see Tree::work), or a trial changes nothing. Returns the number of expansions.
    std::size_t search(const Weights& root, double target_share, double min_target, std::uint64_t max_work, Clock& clock);

    // The node of a belief, -1 if there is none. `slack`: the largest difference between the values of the two.
    Index find(Weights belief, float& slack);
    double upper(Index node) const { return nodes_[as_size(node)].upper; }

  private:
    struct Node {
        double upper, lower;
        std::size_t first, branches = 0;  // positions of the belief and of the first branch
        std::uint32_t size, branch_count = 0;
        std::uint64_t trial = 0;  // the last trial that passed it
        bool expanded = false;
        Stamp points = 0, vectors = 0;  // the bounds include all points and vectors with earlier stamps
    };
    struct Branch {
        double reward, upper;
        std::size_t first;
        std::uint32_t count;
    };
    struct Child {
        double probability;
        Index node;
        float slack;
    };
    Index look_up(const Weights& belief, std::uint64_t hash, float& slack) const;
    Index find_or_add(const Weights& belief, float& slack);
    void refresh(Index node);
    void expand(Index node);
    Index back_up(Index node);
    Weights belief_of(const Node& node) const;

    Tree& tree_;
    const Model& model_;
    Renamings renamings_;
    Successors successors_;
    std::vector<Node> nodes_;
    std::vector<Index> states_;    // of all beliefs
    std::vector<double> weights_;  // of all beliefs
    std::vector<Branch> branches_;
    std::vector<Child> children_;
    std::unordered_multimap<std::uint64_t, Index> index_;
    std::uint64_t work_ = 0, trials_ = 0;
    Weights next_;  // reusable memory
};

}  // namespace lcorpp
