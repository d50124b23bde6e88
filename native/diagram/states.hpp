// States of a fixed number of bits, and sets of them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace lcorpp {

using Word = std::uint64_t;
using Index = std::uint32_t;

constexpr Index no_index = ~Index{0};

inline int count_trailing_zeros(Word word) {
#if defined(_MSC_VER)
    int count = 0;
    while (!(word >> count & 1)) ++count;
    return count;
#else
    return __builtin_ctzll(word);
#endif
}

inline bool has_bit(const Word* words, std::size_t bit) { return words[bit / 64] >> (bit % 64) & 1; }
inline void set_bit(Word* words, std::size_t bit) { words[bit / 64] |= Word{1} << (bit % 64); }

// Call a function with the number of each bit that is set.
template <typename Function>
void for_each_bit(const Word* words, std::size_t n_words, Function function) {
    for (std::size_t w = 0; w < n_words; ++w) {
        for (Word rest = words[w]; rest; rest &= rest - 1) {
            function(64 * w + static_cast<std::size_t>(count_trailing_zeros(rest)));
        }
    }
}

// Different states, numbered in the order of their insertion. Open addressing, at most half full.
class StateSet {
  public:
    explicit StateSet(std::size_t n_words) : n_words_(n_words), places_(16, no_index) {}

    std::size_t size() const { return size_; }
    const Word* state(std::size_t number) const { return words_.data() + number * n_words_; }
    std::size_t memory() const { return words_.capacity() * sizeof(Word) + places_.size() * sizeof(Index); }

    // Return the number of a state, `no_index` if it is not there.
    Index find(const Word* state) const { return places_[locate(state)]; }

    // Return the number of a state, which is added if it is new.
    Index insert(const Word* state) {
        std::size_t place = locate(state);
        if (places_[place] != no_index) return places_[place];
        if (2 * (size_ + 1) > places_.size()) {
            grow();
            place = locate(state);
        }
        words_.insert(words_.end(), state, state + n_words_);
        return places_[place] = static_cast<Index>(size_++);
    }

    std::vector<Word> take() { return std::move(words_); }

  private:
    std::size_t locate(const Word* state) const {
        Word hash = 0x9e3779b97f4a7c15;
        for (std::size_t w = 0; w < n_words_; ++w) {
            hash ^= state[w];
            hash *= 0xff51afd7ed558ccd;
            hash ^= hash >> 32;
        }
        const std::size_t mask = places_.size() - 1;
        std::size_t place = hash & mask;
        while (places_[place] != no_index && !std::equal(state, state + n_words_, this->state(places_[place]))) {
            place = (place + 1) & mask;
        }
        return place;
    }

    void grow() {
        places_.assign(2 * places_.size(), no_index);
        for (std::size_t number = 0; number < size_; ++number) {
            places_[locate(state(number))] = static_cast<Index>(number);
        }
    }

    std::size_t n_words_, size_ = 0;
    std::vector<Word> words_;
    std::vector<Index> places_;
};

}  // namespace lcorpp
