#include "diagram.hpp"

#include <map>
#include <set>

namespace lcorpp {

namespace {

constexpr std::size_t max_shared_words = 1 << 16;  // of states of steps whose arcs later steps may share

}  // namespace

Diagram::Diagram(std::vector<std::vector<int>> children, std::vector<int> roots, std::size_t n_words, bool is_consistent)
    : children_(std::move(children)), roots_(std::move(roots)), n_words_(n_words), states_(children_.size()) {
    std::vector<int> n_parents(children_.size(), 0);
    const auto add = [&](int step, std::size_t least) {
        if (step < static_cast<int>(least) || static_cast<std::size_t>(step) >= children_.size() || ++n_parents[static_cast<std::size_t>(step)] > 1) {
            throw std::invalid_argument("steps that are no tree in depth-first order");
        }
    };
    for (const int root : roots_) add(root, 0);
    for (std::size_t step = 0; step < children_.size(); ++step) {
        for (const int child : children_[step]) add(child, step + 1);
    }
    if (std::count(n_parents.begin(), n_parents.end(), 0)) throw std::invalid_argument("a step without a parent that is no root");
    if (!n_words_) throw std::invalid_argument("states without bits");
    const auto start = std::make_shared<const std::vector<Word>>(is_consistent ? n_words : 0, 0);
    for (const int root : roots_) states_[static_cast<std::size_t>(root)] = start;
}

std::vector<std::vector<Word>> Diagram::enter(std::shared_ptr<Transition> transition, bool is_shared) {
    const std::size_t step = arcs_.size();
    if (step >= children_.size()) throw std::invalid_argument("all steps are expanded");
    if (transition->n_words() != n_words_ || transition->live_masks().size() != children_[step].size()) {
        throw std::invalid_argument("a transition that does not fit the step");
    }
    transition_ = std::move(transition);
    const std::vector<Word>& states = *states_[step];
    is_shared_ = is_shared && states.size() <= max_shared_words;
    level_ = nullptr;
    if (is_shared_) {
        for (Level& level : known_[transition_.get()]) {
            if (level.states == states_[step] || *level.states == states) {
                level_ = &level;
                return {};
            }
        }
    }
    StateSet missing(n_words_);
    std::vector<Word> own(n_words_);
    for (std::size_t i = 0; i < states.size(); i += n_words_) {
        if (transition_->find_input(states.data() + i) != no_index) continue;
        for (std::size_t w = 0; w < n_words_; ++w) own[w] = states[i + w] & transition_->input_mask()[w];
        missing.insert(own.data());
    }
    std::vector<std::vector<Word>> inputs;
    for (std::size_t i = 0; i < missing.size(); ++i) inputs.emplace_back(missing.state(i), missing.state(i) + n_words_);
    return inputs;
}

namespace {

// Numbers equal values.
template <typename T>
class Interner {
  public:
    int number(const T& value) {
        const auto [at, is_new] = numbers_.emplace(value, static_cast<int>(values_.size()));
        if (is_new) values_.push_back(&at->first);
        return at->second;
    }
    const T& value(int number) const { return *values_[static_cast<std::size_t>(number)]; }

  private:
    std::map<T, int> numbers_;
    std::vector<const T*> values_;
};

void append_arcs(Arcs& own, const Arcs& arcs, std::size_t node, const std::vector<char>* kept) {
    own.first.push_back(static_cast<Index>(own.outcomes.size()));
    for (Index arc = arcs.first[node]; arc < arcs.first[node + 1]; ++arc) {
        if (kept != nullptr && !(*kept)[arc]) continue;
        own.outcomes.push_back(arcs.outcomes[arc]);
        for (std::size_t branch = 0; branch < own.targets.size(); ++branch) own.targets[branch].push_back(arcs.targets[branch][arc]);
    }
}

using SharedArcs = std::shared_ptr<const Arcs>;

constexpr int all_nodes = -1;  // in place of the number of a set of nodes

}  // namespace

// Equal steps share their arcs before and after.
void Diagram::prune() {
    if (arcs_.size() < children_.size()) throw std::invalid_argument("a step that is not expanded");
    const std::size_t n = children_.size();
    Interner<std::vector<char>> alive_sets;  // node -> whether it is in a world
    std::vector<int> alive(n, all_nodes);    // of each step
    std::map<std::pair<SharedArcs, std::vector<int>>, std::pair<SharedArcs, int>> cut;
    for (std::size_t step = n; step-- > 0;) {
        std::vector<int> below;
        for (const int child : children_[step]) below.push_back(alive[static_cast<std::size_t>(child)]);
        const auto [known, is_new] = cut.try_emplace({arcs_[step], below});
        if (is_new) {
            const Arcs& arcs = *arcs_[step];
            std::vector<char> kept(arcs.size(), 1), nodes(arcs.n_nodes(), 0);
            bool has_dead = false;
            for (std::size_t branch = 0; branch < below.size(); ++branch) {
                if (below[branch] == all_nodes) continue;
                has_dead = true;
                const auto& targets = alive_sets.value(below[branch]);
                for (std::size_t arc = 0; arc < arcs.size(); ++arc) kept[arc] &= targets[arcs.targets[branch][arc]];
            }
            bool all = true;
            for (std::size_t node = 0; node < arcs.n_nodes(); ++node) {
                for (Index arc = arcs.first[node]; arc < arcs.first[node + 1]; ++arc) nodes[node] |= kept[arc];
                all &= nodes[node];
            }
            known->second = {arcs_[step], all ? all_nodes : alive_sets.number(nodes)};
            if (has_dead) {
                auto own = std::make_shared<Arcs>();
                own->targets.resize(arcs.targets.size());
                for (std::size_t node = 0; node < arcs.n_nodes(); ++node) append_arcs(*own, arcs, node, &kept);
                own->first.push_back(static_cast<Index>(own->outcomes.size()));
                known->second.first = own;
            }
        }
        std::tie(arcs_[step], alive[step]) = known->second;
    }
    cut.clear();
    bool has_worlds = true;
    for (const int root : roots_) has_worlds &= arcs_[static_cast<std::size_t>(root)]->size() > 0;
    if (!has_worlds) {
        for (std::size_t step = 0; step < n; ++step) {
            auto none = std::make_shared<Arcs>();
            none->targets.resize(children_[step].size());
            none->first.push_back(0);
            arcs_[step] = none;
        }
    }
    Interner<std::vector<Index>> numberings;  // node -> its new number, `no_index` if no arc reaches it
    std::vector<int> numbering(n, all_nodes);
    std::map<std::pair<SharedArcs, int>, std::pair<SharedArcs, std::vector<int>>> renumbered;
    n_arcs_ = 0;
    for (std::size_t step = 0; step < n && has_worlds; ++step) {
        const auto [known, is_new] = renumbered.try_emplace({arcs_[step], numbering[step]});
        if (is_new) {
            auto own = std::make_shared<Arcs>(*arcs_[step]);
            if (numbering[step] != all_nodes) {
                const Arcs& arcs = *arcs_[step];
                const std::vector<Index> numbers = numberings.value(numbering[step]);
                own = std::make_shared<Arcs>();
                own->targets.resize(arcs.targets.size());
                for (std::size_t node = 0; node < arcs.n_nodes(); ++node) {
                    if (numbers[node] != no_index) append_arcs(*own, arcs, node, nullptr);
                }
                own->first.push_back(static_cast<Index>(own->outcomes.size()));
            }
            std::vector<int> following;
            for (std::size_t branch = 0; branch < own->targets.size(); ++branch) {
                const auto child = static_cast<std::size_t>(children_[step][branch]);
                std::vector<Index> numbers(arcs_[child]->n_nodes(), no_index);
                for (const Index target : own->targets[branch]) numbers[target] = 0;
                Index count = 0;
                for (Index& number : numbers) {
                    if (number == 0) number = count++;
                }
                following.push_back(all_nodes);
                if (count == numbers.size()) continue;
                for (Index& target : own->targets[branch]) target = numbers[target];
                following.back() = numberings.number(numbers);
            }
            known->second = {own, following};
        }
        arcs_[step] = known->second.first;
        for (std::size_t branch = 0; branch < children_[step].size(); ++branch) {
            numbering[static_cast<std::size_t>(children_[step][branch])] = known->second.second[branch];
        }
        n_arcs_ += arcs_[step]->size();
    }
    has_dead_ends_ = false;
}

}  // namespace lcorpp
