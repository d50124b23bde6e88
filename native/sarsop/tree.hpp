// The belief tree and the two bounds its nodes share.
// Source: Kurniawati, Hsu and Lee, "SARSOP", RSS 2008, sections III and IV.
#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <unordered_map>
#include <vector>

#include "model.hpp"
#include "origins.hpp"
#include "sawtooth.hpp"
#include "vectors.hpp"

namespace lcorpp {

// Entries of outcomes, 12 bytes each, that are kept with their nodes; beyond, they are worked out anew.
constexpr std::size_t kRoom = std::size_t{1} << 25;

// Share of the largest value that a new bound must gain; less is rounding.
constexpr double kGain = 1e-11;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// What may be observed after an action. Bounds are those of the next belief times the probability.
struct Child {
    Index observation;
    Index group;      // the block of the next belief
    Index link = -1;  // the node of the next belief, once it was visited
    double probability;
    double lower = -kInfinity, upper = kInfinity;
    double apart = 0.0;  // how far the values of the next belief and of its node may differ
    Stamp best = -1;     // the vector that gives `lower`
};

// One action at a belief. It is worked out when it is looked at first: until then the informed bound stands
// for its upper bound.
struct Branch {
    bool open = false, refreshed = false;  // its children are known; their upper bounds were asked for
    double immediate = 0.0;
    double lower = -kInfinity, upper = kInfinity;
    Stamp seen_vectors = 0, seen_points = 0;
    std::vector<Child> children;
    std::unique_ptr<Outcomes> outcomes;  // kept while there is room: most visits need them
};

struct Node {
    Weights belief;
    Index group;  // its block; one more than the last for a belief over several blocks
    double low = -kInfinity, high = kInfinity;
    std::vector<Branch> branches;  // one for each action
    Stamp witness = -1;            // the vector that is best here
    double held = -kInfinity;      // its value
    Stamp seen_vectors = 0;
    Stamp point = -1;              // of this belief in the upper bound
    double surface = kInfinity;    // the upper bound here when last asked
    Stamp seen_surface = 0;
    double informed = 0.0;         // the initial upper bound here
    Index entropy = 0;             // in bins
};

class Tree {
  public:
    // informed: (A, S) Q values above the truth. blind: (A, S) the value of each action done for ever.
    Tree(const Model& model, const std::vector<double>& informed, const std::vector<double>& blind);
    Tree(const Tree&) = delete;
    Tree& operator=(const Tree&) = delete;

    const Model& model;

    // The node of a belief, made where there is none.
    Index node(Weights belief);
    // The node of a child.
    Index child(Index node, Index action, std::size_t number);

    // Bring the bounds of a node up to date with the vectors and points since its last visit.
    void refresh(Index node);
    // The action to follow from a node, best in the upper or the lower bound, with both its bounds up to date.
    Index look(Index node, bool below);
    // That of one action's upper bound, where it is not the best one.
    void refresh_upper(Index node, Index action);

    // Add the vector that is best at a node, and lower the upper bound there (RSS 2008, algorithm 3).
    void backup(Index node);

    // Take over what is known of the same model: a vector over the states of a group, a point at a belief.
    void add_vector(Index group, const std::vector<double>& vector, Index action);
    void add_point(const Weights& belief, double value);

    // The values at a node that the vectors and points give by themselves.
    double lower_at(Index node);
    double upper_at(Index node);

    // Keep the vectors that are best, or nearly, at a belief that the roots reach by actions that may still be
    // optimal; see pruning.cpp. Sets are looked at when they have grown since the last time.
    void prune(const std::vector<Index>& roots, double delta, double cap, double growth);

    Index best_lower_action(Index node) const;
    Index best_upper_action(Index node) const;

    std::deque<Node> nodes;  // they stay where they are while others come
    std::vector<VectorSet> sets;  // for each block; the last for beliefs over several
    Origins origins;              // of the vectors
    Sawtooth sawtooth;
    double scale = 1.0;           // the largest value in the model: what rounding is measured by

    std::size_t vectors() const;
    // The states of a group.
    const std::vector<Index>& states_of(Index group) const {
        return static_cast<std::size_t>(group) < model.members.size() ? model.members[static_cast<std::size_t>(group)]
                                                                      : everything_;
    }

  private:
    const Outcomes& outcomes(Node& node, Index action);
    void refresh_lower(Node& node, Index action);
    void refresh_upper(Node& node, Index action);
    void witness(Node& node);
    // The new vector, and the stamps of those it goes on with.
    std::vector<double> vector(Node& node, Index action, std::vector<Stamp>& from);
    Best best(Index group, const Index* states, const double* weights, std::size_t n, std::size_t first);
    Index group_of(const Weights& belief) const;
    std::vector<Index> reachable(const std::vector<Index>& roots) const;
    void prune_set(Index group, const std::vector<Index>& at, double delta, double cap);

    Successors successors_;
    Stamp next_vector_ = 0;
    std::size_t room_ = kRoom;  // entries of outcomes that may still be kept
    std::unordered_multimap<std::uint64_t, Index> known_;
    std::vector<Index> everything_;
    std::vector<std::size_t> kept_;  // by group, how many vectors the last pruning left
    std::vector<Index> places_;      // scratch
    std::vector<double> future_;     // (S) scratch
};

}  // namespace lcorpp
