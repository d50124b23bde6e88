// The closure of implications between atoms, in the bits of a state; see transitions/closure.py.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "states.hpp"

namespace lcorpp {

struct Implication {
    int bit;  // -1 for an implication without a condition
    int body, head;
};

// Atoms are numbered: 0 is true, then follow those before and after the step, the contradiction (`falsum`), and goals.
class Closure {
  public:
    // goals: for each goal after the step, the bits of the implications of which it is the head: (body, bit).
    Closure(std::size_t n_words, std::vector<Implication> closed, std::vector<Implication> added,
            std::vector<Implication> targets, int falsum, int n_atoms, std::vector<std::vector<std::pair<int, int>>> goals)
        : closed_(std::move(closed)), added_(std::move(added)), targets_(std::move(targets)),
          falsum_(static_cast<std::size_t>(falsum)), n_atoms_(static_cast<std::size_t>(n_atoms)),
          n_words_((n_atoms_ + 63) / 64), goals_(std::move(goals)), read_(n_words, 0),
          follows_(falsum_ * n_words_), reached_(n_words_) {
        for (const auto* implications : {&closed_, &added_}) {
            for (const Implication& own : *implications) {
                if (own.bit >= 0) set_bit(read_.data(), static_cast<std::size_t>(own.bit));
            }
        }
        std::stable_sort(targets_.begin(), targets_.end(),
                         [](const Implication& a, const Implication& b) { return a.body < b.body; });
    }

    // Change a state to that after the step; return whether it is possible: no contradiction, all goals in reach.
    bool apply(Word* state) {
        const std::size_t n = n_words_;
        std::fill(follows_.begin(), follows_.end(), 0);
        for (std::size_t atom = 0; atom < falsum_; ++atom) set_bit(follows(atom), atom);
        for (const Implication& own : closed_) {
            if (has_bit(state, static_cast<std::size_t>(own.bit))) set_bit(follows(own.body), static_cast<std::size_t>(own.head));
        }
        const Word* is_true = follows(0);
        for (const Implication& own : added_) {
            const auto body = static_cast<std::size_t>(own.body), head = static_cast<std::size_t>(own.head);
            if (own.bit >= 0 && !has_bit(state, static_cast<std::size_t>(own.bit))) continue;
            if (has_bit(is_true, head) || has_bit(follows(body), head)) continue;
            if (head < falsum_) {
                std::copy_n(follows(head), n, reached_.data());
            } else {
                std::fill(reached_.begin(), reached_.end(), 0);
                set_bit(reached_.data(), head);
            }
            for (std::size_t atom = 0; atom < falsum_; ++atom) {
                Word* row = follows(atom);
                if (!has_bit(row, body)) continue;
                for (std::size_t w = 0; w < n; ++w) row[w] |= reached_[w];
            }
        }
        if (has_bit(is_true, falsum_)) return false;
        for (std::size_t w = 0; w < read_.size(); ++w) state[w] &= ~read_[w];
        if (n_atoms_ > falsum_ + 1 && !write_goals(state)) return false;
        for (const Implication& own : targets_) {
            const auto body = static_cast<std::size_t>(own.body), head = static_cast<std::size_t>(own.head);
            const Word* row = follows(body);
            if (!has_bit(row, head)) continue;
            if (body != 0) {
                // what is true needs no other reason, what follows from it is true; the false has no effect
                if (has_bit(is_true, body)) continue;
                if (has_bit(row, falsum_) ? head != falsum_ : has_bit(is_true, head)) continue;
            }
            set_bit(state, static_cast<std::size_t>(own.bit));
        }
        return true;
    }

  private:
    Word* follows(std::size_t atom) { return follows_.data() + atom * n_words_; }

    // Set the bits of the goals that are not yet reached; return whether all can be. Redundant goals are left out.
    bool write_goals(Word* state) {
        using Mask = std::vector<Word>;
        std::vector<Mask> masks;
        for (std::size_t goal = falsum_ + 1; goal < n_atoms_; ++goal) {
            if (has_bit(follows(0), goal)) continue;
            bool is_open = false;
            for (std::size_t atom = 0; atom < falsum_ && !is_open; ++atom) is_open = has_bit(follows(atom), goal);
            if (!is_open) continue;
            Mask mask(n_words_, 0);
            bool is_possible = false;
            if (!goals_.empty()) {
                for (const auto& [atom, bit] : goals_.front()) {
                    const Word* row = follows(static_cast<std::size_t>(atom));
                    if (!has_bit(row, goal) || has_bit(row, falsum_)) continue;
                    set_bit(mask.data(), static_cast<std::size_t>(atom));
                    is_possible = true;
                }
            }
            if (!is_possible) return false;
            masks.push_back(std::move(mask));
        }
        std::sort(masks.begin(), masks.end());
        masks.erase(std::unique(masks.begin(), masks.end()), masks.end());
        const auto includes = [&](const Mask& large, const Mask& small) {
            for (std::size_t w = 0; w < n_words_; ++w) {
                if (small[w] & ~large[w]) return false;
            }
            return true;
        };
        std::size_t number = 0;
        for (const Mask& mask : masks) {
            bool is_redundant = false;
            for (const Mask& other : masks) is_redundant |= &other != &mask && includes(mask, other);
            if (is_redundant || number >= goals_.size()) continue;
            for (const auto& [atom, bit] : goals_[number]) {
                if (has_bit(mask.data(), static_cast<std::size_t>(atom))) set_bit(state, static_cast<std::size_t>(bit));
            }
            ++number;
        }
        return true;
    }

    std::vector<Implication> closed_, added_, targets_;
    std::size_t falsum_, n_atoms_, n_words_;
    std::vector<std::vector<std::pair<int, int>>> goals_;
    std::vector<Word> read_;               // the bits of the state that are read
    std::vector<Word> follows_, reached_;  // of the current state: atom -> mask of the atoms that follow from it
};

}  // namespace lcorpp
