// The outcomes of a step and their effect on the state; see transitions/transition.py.
#pragma once

#include <stdexcept>
#include <utility>
#include <vector>

#include "closure.hpp"
#include "states.hpp"

namespace lcorpp {

struct Choice {
    Index effect, outcome;
};

class Transition {
  public:
    using Bits = std::vector<Word>;

    Transition(std::size_t n_words, Bits input_mask, std::vector<Bits> live_masks, std::vector<std::pair<Bits, Bits>> absorptions)
        : n_words_(n_words), input_mask_(std::move(input_mask)), live_masks_(std::move(live_masks)),
          absorptions_(std::move(absorptions)), inputs_(n_words), scratch_(n_words) {}

    std::size_t n_words() const { return n_words_; }
    const std::vector<Bits>& live_masks() const { return live_masks_; }
    std::size_t n_effects() const { return effects_.size(); }
    const std::vector<Choice>& choices(std::size_t input) const { return choices_[input]; }

    void add_closure(Closure closure) { closures_.push_back(std::move(closure)); }

    // targets: n_words words for each bit of `moves`, in their order.
    Index add_effect(Bits sets, Bits forbids, Bits moves, const Bits& targets) {
        Effect effect{std::move(sets), std::move(forbids), std::move(moves), {0}, {}};
        for (std::size_t k = 0; k < targets.size(); k += n_words_) {
            for_each_bit(targets.data() + k, n_words_, [&](std::size_t bit) { effect.targets.push_back(static_cast<Index>(bit)); });
            effect.first.push_back(static_cast<Index>(effect.targets.size()));
        }
        effects_.push_back(std::move(effect));
        return static_cast<Index>(effects_.size() - 1);
    }

    void add_choices(const Bits& input, std::vector<Choice> choices) {
        for (const Choice& choice : choices) {
            if (choice.effect >= effects_.size()) throw std::invalid_argument("an effect that the transition does not have");
        }
        if (inputs_.insert(input.data()) == choices_.size()) choices_.push_back(std::move(choices));
    }

    // The number of the bits of a state on which the outcomes depend, `no_index` if they have no choices yet.
    Index find_input(const Word* state) const {
        for (std::size_t w = 0; w < n_words_; ++w) scratch_[w] = state[w] & input_mask_[w];
        return inputs_.find(scratch_.data());
    }
    const Bits& input_mask() const { return input_mask_; }

    // Write the state after an outcome, for all branches; return whether the outcome is possible.
    bool advance(const Word* state, Index number, Word* after) {
        const Effect& effect = effects_[number];
        for (std::size_t w = 0; w < n_words_; ++w) {
            if (state[w] & effect.forbids[w]) return false;
            after[w] = state[w] | effect.sets[w];
        }
        std::size_t rank = 0;
        for (std::size_t w = 0; w < n_words_; ++w) {
            for (Word rest = effect.moves[w]; rest; rest &= rest - 1, ++rank) {
                if (!(state[w] & rest & -rest)) continue;
                for (Index k = effect.first[rank]; k < effect.first[rank + 1]; ++k) set_bit(after, effect.targets[k]);
            }
        }
        for (const auto& [satisfied, redundant] : absorptions_) {
            bool is_satisfied = false;
            for (std::size_t w = 0; w < n_words_; ++w) is_satisfied |= (after[w] & satisfied[w]) != 0;
            if (!is_satisfied) continue;
            for (std::size_t w = 0; w < n_words_; ++w) after[w] &= ~redundant[w];
        }
        for (Closure& closure : closures_) {
            if (!closure.apply(after)) return false;
        }
        return true;
    }

  private:
    struct Effect {
        Bits sets, forbids, moves;
        std::vector<Index> first, targets;  // the bits to set for each bit of `moves`
    };

    std::size_t n_words_;
    Bits input_mask_;
    std::vector<Bits> live_masks_;
    std::vector<std::pair<Bits, Bits>> absorptions_;
    std::vector<Closure> closures_;
    std::vector<Effect> effects_;
    StateSet inputs_;
    std::vector<std::vector<Choice>> choices_;
    mutable Bits scratch_;
};

}  // namespace lcorpp
