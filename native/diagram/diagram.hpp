// A decision diagram; see diagram/decision_diagram.py.
#pragma once

#include <memory>
#include <stdexcept>
#include <unordered_map>
#include <vector>

#include "transition.hpp"

namespace lcorpp {

// The arcs of a step, those of each node one after the other.
struct Arcs {
    std::vector<Index> first;                 // of each node, and the end
    std::vector<std::vector<Index>> targets;  // for each branch the node to which each arc leads
    std::vector<Index> outcomes;              // the label of each arc

    std::size_t size() const { return outcomes.size(); }
    std::size_t n_nodes() const { return first.empty() ? 0 : first.size() - 1; }
    std::size_t memory() const { return sizeof(Index) * outcomes.size() * (2 + targets.size()); }
};

// Steps are numbered in depth-first order: a step comes before its children.
class Diagram {
  public:
    // children: of each step. roots: the steps without parent; with `is_consistent` each has one node, otherwise none.
    Diagram(std::vector<std::vector<int>> children, std::vector<int> roots, std::size_t n_words, bool is_consistent);

    // Enter the next step; return the bits of its nodes that have no choices yet.
    std::vector<std::vector<Word>> enter(std::shared_ptr<Transition> transition, bool is_shared);

    // Expand the step that was entered last, whose inputs must all have choices. `check` is called from time to time, and
    // may throw. Returns whether the diagram is within the limit of memory; if not, the step is not expanded.
    template <typename Check>
    bool expand(std::size_t max_bytes, Check& check);

    // Drop nodes without a world and arcs to them, then nodes that no arc reaches.
    void prune();

    bool has_dead_ends() const { return has_dead_ends_; }
    std::size_t n_arcs() const { return n_arcs_; }
    std::size_t n_steps() const { return children_.size(); }
    const std::vector<std::vector<int>>& children() const { return children_; }
    const std::vector<int>& roots() const { return roots_; }
    const Arcs& arcs(std::size_t step) const {
        if (step >= arcs_.size()) throw std::invalid_argument("a step that is not expanded");
        return *arcs_[step];
    }

  private:
    using States = std::shared_ptr<const std::vector<Word>>;
    struct Level {
        std::shared_ptr<Transition> transition;  // which may not be deleted while its address is a key
        States states;
        std::shared_ptr<const Arcs> arcs;
        std::vector<States> following;
        bool has_dead_ends;
    };

    std::vector<std::vector<int>> children_;
    std::vector<int> roots_;
    std::size_t n_words_;
    std::vector<States> states_;  // of each step that is entered later
    std::vector<std::shared_ptr<const Arcs>> arcs_;
    std::unordered_map<const Transition*, std::vector<Level>> known_;
    std::shared_ptr<Transition> transition_;  // of the step that was entered last
    Level* level_ = nullptr;                  // an equal step, or none
    bool is_shared_ = false, has_dead_ends_ = false;
    std::size_t n_arcs_ = 0, memory_ = 0;
};

template <typename Check>
bool Diagram::expand(std::size_t max_bytes, Check& check) {
    const std::size_t step = arcs_.size();
    if (transition_ == nullptr) throw std::invalid_argument("no step was entered");
    const auto& children = children_[step];
    const States states = states_[step];
    std::vector<States> following;
    if (level_ == nullptr) {
        Transition& transition = *transition_;
        auto arcs = std::make_shared<Arcs>();
        const std::size_t n_nodes = states->size() / n_words_;
        arcs->targets.resize(children.size());
        arcs->first.reserve(n_nodes + 1);
        std::vector<StateSet> reached(children.size(), StateSet(n_words_));
        std::vector<Word> after(n_words_), own(n_words_);
        std::size_t work = 0;
        bool has_dead_ends = false;
        for (std::size_t node = 0; node < n_nodes; ++node) {
            const Word* state = states->data() + node * n_words_;
            arcs->first.push_back(static_cast<Index>(arcs->outcomes.size()));
            const Index input = transition.find_input(state);
            if (input == no_index) throw std::invalid_argument("a state of the input bits without choices");
            for (const Choice& choice : transition.choices(input)) {
                ++work;
                if (!transition.advance(state, choice.effect, after.data())) continue;
                arcs->outcomes.push_back(choice.outcome);
                for (std::size_t branch = 0; branch < children.size(); ++branch) {
                    const auto& mask = transition.live_masks()[branch];
                    for (std::size_t w = 0; w < n_words_; ++w) own[w] = after[w] & mask[w];
                    arcs->targets[branch].push_back(reached[branch].insert(own.data()));
                }
            }
            has_dead_ends |= arcs->first.back() == arcs->outcomes.size();
            if (work >= 65536) {
                check(work);
                work = 0;
                std::size_t memory = memory_ + arcs->memory() + states->size() * sizeof(Word);
                for (const StateSet& set : reached) memory += set.memory();
                if (memory > max_bytes || arcs->outcomes.size() > no_index / 2) return false;
            }
        }
        arcs->first.push_back(static_cast<Index>(arcs->outcomes.size()));
        for (StateSet& set : reached) following.push_back(std::make_shared<const std::vector<Word>>(set.take()));
        has_dead_ends_ |= has_dead_ends;
        memory_ += arcs->memory();
        arcs_.push_back(arcs);
        if (is_shared_) known_[transition_.get()].push_back({transition_, states, arcs, following, has_dead_ends});
    } else {
        arcs_.push_back(level_->arcs);
        following = level_->following;
        has_dead_ends_ |= level_->has_dead_ends;
    }
    n_arcs_ += arcs_.back()->size();
    transition_ = nullptr;
    states_[step] = nullptr;
    if (arcs_.size() == children_.size()) known_.clear();
    for (std::size_t branch = 0; branch < children.size(); ++branch) {
        states_[static_cast<std::size_t>(children[branch])] = following[branch];
    }
    return memory_ <= max_bytes;
}

}  // namespace lcorpp
