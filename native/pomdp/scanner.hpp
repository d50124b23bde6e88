// Plain statements of the tables T, O and R in .pomdp text: those that large files consist of.
//
// Plain are an entry with known names and one number, and a row of T or O with a known action and state and one number
// per column. All other statements, and all errors, are left to the reader in Python.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace lcorpp {

// Names and numbers of the states, actions or observations, with their indices; -1 for `*`.
class Names {
  public:
    void add(std::string name, std::int32_t index);
    // Whether the name is known; sets its index.
    bool find(std::string_view name, std::int32_t& index) const;

  private:
    std::deque<std::string> texts_;  // a deque, so that the views into it stay valid
    std::unordered_map<std::string_view, std::int32_t> index_;
};

// Plain statements of one table in the order of the text. Offsets are in bytes from the start of the text.
struct PlainTable {
    std::size_t references = 0;  // number of references of an entry

    std::vector<std::int32_t> entry_indices;  // (entries, references)
    std::vector<double> entry_values;         // (entries)
    std::vector<std::int64_t> entry_offsets;  // (entries) of the number

    std::vector<std::int32_t> row_indices;     // (rows, 2) action and state, -1 for `*`
    std::vector<std::int64_t> row_offsets;     // (rows) of the first number
    std::vector<std::int64_t> row_begins{0};   // (rows + 1) index of the first nonzero number of each row
    std::vector<std::int32_t> row_columns;     // (nonzero numbers)
    std::vector<double> row_values;            // (nonzero numbers)
};

struct PlainStatements {
    std::size_t end = 0;  // offset of the first statement that was not read, or the length of the text
    PlainTable transition{3}, observation{3}, reward{4};
};

struct ScanOptions {
    std::size_t max_numbers;        // stop after this many numbers
    double max_probability;         // a larger number of T or O is left to the reader, as are negative ones
    std::size_t states, observations;
    std::size_t reward_references;  // of an entry of R: 4, or 3 in an MDP, which has no observations
};

// Read plain statements from an offset on, which is that of a token.
PlainStatements scan_statements(std::string_view text, std::size_t offset, const Names& actions, const Names& states,
                                const Names& observations, const ScanOptions& options);

// Read numbers from an offset on, up to a count. Returns the offset of the next token; `columns` and `values` receive the
// positions and values of the nonzero ones. If there are fewer numbers, or one is not finite, returns npos.
std::size_t scan_numbers(std::string_view text, std::size_t offset, std::size_t count, std::vector<std::int32_t>& columns,
                         std::vector<double>& values);

}  // namespace lcorpp
