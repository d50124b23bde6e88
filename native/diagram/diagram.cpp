#include "diagram.hpp"

#include <stdexcept>

namespace lcorpp {

namespace {

constexpr std::size_t max_shared_words = 1 << 16;  // of states of steps whose arcs later steps may share

}  // namespace

Diagram::Diagram(std::vector<std::vector<int>> children, std::vector<int> roots, std::size_t n_words, bool is_consistent)
    : children_(std::move(children)), roots_(std::move(roots)), n_words_(n_words), states_(children_.size()) {
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

void Diagram::prune() {
    const std::size_t n = children_.size();
    std::vector<std::vector<char>> is_alive(n);  // node -> whether it is in a world, empty if all are
    for (std::size_t step = n; step-- > 0;) {
        const Arcs& arcs = *arcs_[step];
        std::vector<char> kept(arcs.size(), 1);
        bool has_dead = false;
        for (std::size_t branch = 0; branch < children_[step].size(); ++branch) {
            const auto& alive = is_alive[static_cast<std::size_t>(children_[step][branch])];
            if (alive.empty()) continue;
            for (std::size_t arc = 0; arc < arcs.size(); ++arc) kept[arc] &= alive[arcs.targets[branch][arc]];
            has_dead = true;
        }
        std::vector<char> alive(arcs.n_nodes(), 0);
        bool all = true;
        for (std::size_t node = 0; node < arcs.n_nodes(); ++node) {
            for (Index arc = arcs.first[node]; arc < arcs.first[node + 1]; ++arc) alive[node] |= kept[arc];
            all &= alive[node];
        }
        if (!all) is_alive[step] = std::move(alive);
        if (!has_dead) continue;
        auto own = std::make_shared<Arcs>();
        own->targets.resize(arcs.targets.size());
        for (std::size_t node = 0; node < arcs.n_nodes(); ++node) {
            own->first.push_back(static_cast<Index>(own->outcomes.size()));
            for (Index arc = arcs.first[node]; arc < arcs.first[node + 1]; ++arc) {
                if (!kept[arc]) continue;
                own->outcomes.push_back(arcs.outcomes[arc]);
                for (std::size_t branch = 0; branch < own->targets.size(); ++branch) {
                    own->targets[branch].push_back(arcs.targets[branch][arc]);
                }
            }
        }
        own->first.push_back(static_cast<Index>(own->outcomes.size()));
        arcs_[step] = own;
    }
    bool has_worlds = true;
    for (const int root : roots_) has_worlds &= arcs_[static_cast<std::size_t>(root)]->size() > 0;
    std::vector<std::vector<Index>> numbers(n);  // node -> its new number, `no_index` if it is dropped; empty if all stay
    n_arcs_ = 0;
    for (std::size_t step = 0; step < n; ++step) {
        const Arcs& arcs = *arcs_[step];
        auto own = std::make_shared<Arcs>();
        own->targets.resize(arcs.targets.size());
        if (!has_worlds) {
            own->first.push_back(0);
            arcs_[step] = own;
            continue;
        }
        bool is_changed = false;
        const std::vector<Index>& number = numbers[step];
        if (!number.empty()) {
            is_changed = true;
            for (std::size_t node = 0; node < arcs.n_nodes(); ++node) {
                if (number[node] == no_index) continue;
                own->first.push_back(static_cast<Index>(own->outcomes.size()));
                for (Index arc = arcs.first[node]; arc < arcs.first[node + 1]; ++arc) {
                    own->outcomes.push_back(arcs.outcomes[arc]);
                    for (std::size_t branch = 0; branch < own->targets.size(); ++branch) {
                        own->targets[branch].push_back(arcs.targets[branch][arc]);
                    }
                }
            }
            own->first.push_back(static_cast<Index>(own->outcomes.size()));
        }
        for (std::size_t branch = 0; branch < children_[step].size(); ++branch) {
            const auto child = static_cast<std::size_t>(children_[step][branch]);
            const auto& targets = is_changed ? own->targets[branch] : arcs.targets[branch];
            std::vector<Index> new_numbers(arcs_[child]->n_nodes(), no_index);
            for (const Index target : targets) new_numbers[target] = 0;
            Index count = 0;
            for (Index& target : new_numbers) {
                if (target == 0) target = count++;
            }
            if (count == new_numbers.size()) continue;
            if (!is_changed) {
                *own = arcs;
                is_changed = true;
            }
            for (Index& target : own->targets[branch]) target = new_numbers[target];
            numbers[child] = std::move(new_numbers);
        }
        if (is_changed) arcs_[step] = own;
        n_arcs_ += arcs_[step]->size();
    }
    has_dead_ends_ = false;
    known_.clear();
}

}  // namespace lcorpp
