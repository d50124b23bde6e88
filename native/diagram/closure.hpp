// The closure of implications between atoms, in the bits of a state; see transitions/closure.py.
#pragma once

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "states.hpp"

namespace lcorpp {

struct Implication {
    int bit;  // -1 for an implication without a condition
    int body, head;
};

// Atoms are numbered: 0 is true, then follow those before and after the step, the contradiction (`contradiction`), and goals.
class Closure {
  public:
    // closed: implications with conditions, which are closed before the step.
    // goals: for each goal after the step, the bits of the implications of which it is the head: (body, bit).
    Closure(std::size_t n_words, std::vector<Implication> closed, std::vector<Implication> added,
            std::vector<Implication> targets, int contradiction, int n_atoms, std::vector<std::vector<std::pair<int, int>>> goals)
        : added_(std::move(added)), contradiction_(static_cast<std::size_t>(contradiction)), n_atoms_(static_cast<std::size_t>(n_atoms)),
          n_atom_words_((n_atoms_ + 63) / 64), goals_(std::move(goals)), read_(n_words, 0), closed_(n_words, 0),
          implication_of_(64 * n_words), heads_(contradiction_ * n_atom_words_, 0), bit_of_(contradiction_ * 64 * n_atom_words_),
          follows_(contradiction_ * n_atom_words_), reached_(n_atom_words_) {
        for (const Implication& own : closed) {
            set_bit(closed_.data(), static_cast<std::size_t>(own.bit));
            implication_of_[static_cast<std::size_t>(own.bit)] = {own.body, own.head};
        }
        read_ = closed_;
        for (const Implication& own : added_) {
            if (own.bit >= 0) set_bit(read_.data(), static_cast<std::size_t>(own.bit));
        }
        for (const Implication& own : targets) {
            const auto body = static_cast<std::size_t>(own.body), head = static_cast<std::size_t>(own.head);
            set_bit(heads_.data() + body * n_atom_words_, head);
            bit_of_[body * 64 * n_atom_words_ + head] = own.bit;
            if (bodies_.empty() || bodies_.back() != body) bodies_.push_back(body);
        }
        std::sort(bodies_.begin(), bodies_.end());
        bodies_.erase(std::unique(bodies_.begin(), bodies_.end()), bodies_.end());
    }

    // Change a state to that after the step; return whether it is possible: no contradiction, all goals in reach.
    bool apply(Word* state) { return n_atom_words_ == 1 ? apply_words<1>(state) : apply_words<0>(state); }

  private:
    Word* follows(std::size_t atom, std::size_t n) { return follows_.data() + atom * n; }

    // N: the number of words of a set of atoms, 0 for any.
    template <std::size_t N>
    bool apply_words(Word* state) {
        const std::size_t n = N ? N : n_atom_words_;
        std::fill(follows_.begin(), follows_.end(), 0);
        for (std::size_t atom = 0; atom < contradiction_; ++atom) set_bit(follows(atom, n), atom);
        for (std::size_t w = 0; w < closed_.size(); ++w) {
            for (Word rest = state[w] & closed_[w]; rest; rest &= rest - 1) {
                const auto [body, head] = implication_of_[64 * w + static_cast<std::size_t>(count_trailing_zeros(rest))];
                set_bit(follows(static_cast<std::size_t>(body), n), static_cast<std::size_t>(head));
            }
        }
        const Word* is_true = follows(0, n);
        for (const Implication& own : added_) {
            const auto body = static_cast<std::size_t>(own.body), head = static_cast<std::size_t>(own.head);
            if (own.bit >= 0 && !has_bit(state, static_cast<std::size_t>(own.bit))) continue;
            if (has_bit(is_true, head) || has_bit(follows(body, n), head)) continue;
            if (head < contradiction_) {
                std::copy_n(follows(head, n), n, reached_.data());
            } else {
                std::fill(reached_.begin(), reached_.end(), 0);
                set_bit(reached_.data(), head);
            }
            for (std::size_t atom = 0; atom < contradiction_; ++atom) {
                Word* row = follows(atom, n);
                const Word has_body = -(row[body / 64] >> (body % 64) & 1);
                for (std::size_t w = 0; w < n; ++w) row[w] |= reached_[w] & has_body;
            }
        }
        if (has_bit(is_true, contradiction_)) return false;
        for (std::size_t w = 0; w < read_.size(); ++w) state[w] &= ~read_[w];
        if (n_atoms_ > contradiction_ + 1 && !write_goals(state)) return false;
        for (const std::size_t body : bodies_) {
            const Word* row = follows(body, n);
            const Word* heads = heads_.data() + body * n;
            const int* bits = bit_of_.data() + body * 64 * n;
            // what is true needs no other reason, what follows from it is true; the false has no effect
            if (body != 0 && has_bit(is_true, body)) continue;
            if (body != 0 && has_bit(row, contradiction_)) {
                if (has_bit(heads, contradiction_)) set_bit(state, static_cast<std::size_t>(bits[contradiction_]));
                continue;
            }
            for (std::size_t w = 0; w < n; ++w) {
                for (Word rest = row[w] & heads[w] & ~(body ? is_true[w] : 0); rest; rest &= rest - 1) {
                    set_bit(state, static_cast<std::size_t>(bits[64 * w + static_cast<std::size_t>(count_trailing_zeros(rest))]));
                }
            }
        }
        return true;
    }

    // Set the bits of the goals that are not yet reached; return whether all can be. Redundant goals are left out.
    bool write_goals(Word* state) {
        using Mask = std::vector<Word>;
        std::vector<Mask> masks;
        for (std::size_t goal = contradiction_ + 1; goal < n_atoms_; ++goal) {
            if (has_bit(follows(0, n_atom_words_), goal)) continue;
            bool is_open = false;
            for (std::size_t atom = 0; atom < contradiction_ && !is_open; ++atom) is_open = has_bit(follows(atom, n_atom_words_), goal);
            if (!is_open) continue;
            Mask mask(n_atom_words_, 0);
            bool is_possible = false;
            if (!goals_.empty()) {
                for (const auto& [atom, bit] : goals_.front()) {
                    const Word* row = follows(static_cast<std::size_t>(atom), n_atom_words_);
                    if (!has_bit(row, goal) || has_bit(row, contradiction_)) continue;
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
            for (std::size_t w = 0; w < n_atom_words_; ++w) {
                if (small[w] & ~large[w]) return false;
            }
            return true;
        };
        std::size_t number = 0;
        for (const Mask& mask : masks) {
            bool is_redundant = false;
            for (const Mask& other : masks) is_redundant |= &other != &mask && includes(mask, other);
            if (is_redundant) continue;
            if (number >= goals_.size()) throw std::logic_error("more goals than bits");  // Sperner's theorem bounds them
            for (const auto& [atom, bit] : goals_[number]) {
                if (has_bit(mask.data(), static_cast<std::size_t>(atom))) set_bit(state, static_cast<std::size_t>(bit));
            }
            ++number;
        }
        return true;
    }

    std::vector<Implication> added_;
    std::size_t contradiction_, n_atoms_, n_atom_words_;  // n_atom_words_: words of a set of atoms
    std::vector<std::vector<std::pair<int, int>>> goals_;
    std::vector<Word> read_, closed_;                   // the bits of the state that are read; those of closed implications
    std::vector<std::pair<int, int>> implication_of_;   // bit -> (body, head), of closed implications
    std::vector<std::size_t> bodies_;                   // of the implications after the step
    std::vector<Word> heads_;                           // body -> the atoms that are its heads in these
    std::vector<int> bit_of_;                           // (body, head) -> the bit of this implication
    std::vector<Word> follows_, reached_;               // of the current state: atom -> the atoms that follow from it
};

}  // namespace lcorpp
