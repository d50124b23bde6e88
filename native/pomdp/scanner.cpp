#include "scanner.hpp"

#include <cmath>
#include <limits>
#include <utility>

#include "number.hpp"

namespace lcorpp {

namespace {

constexpr std::size_t kNotFound = std::string_view::npos;

bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

// The offset after white space and comments; a comment ends with its line.
std::size_t skip(std::string_view text, std::size_t at) {
    while (at < text.size()) {
        if (is_space(text[at])) {
            ++at;
        } else if (text[at] == '#') {
            while (at < text.size() && text[at] != '\n' && text[at] != '\r') ++at;
        } else {
            break;
        }
    }
    return at;
}

bool ends_word(std::string_view text, std::size_t at) {
    return at == text.size() || is_space(text[at]) || text[at] == ':' || text[at] == '#';
}

// The end of the word at an offset, the offset itself if there is none. A star is a word of its own. (A number before a
// keyword is not a plain reference: the word is unknown, and the reader splits it.)
std::size_t find_word_end(std::string_view text, std::size_t at) {
    if (at < text.size() && text[at] == '*') return at + 1;
    while (!ends_word(text, at)) ++at;
    return at;
}

bool starts_with(std::string_view text, std::size_t at, std::string_view word) { return text.substr(at, word.size()) == word; }

// Whether a keyword follows, before which a number ends without a space: a row, or a statement with its colon.
bool is_keyword(std::string_view text, std::size_t at) {
    for (const std::string_view word : {"identity", "uniform", "reset"}) {
        if (starts_with(text, at, word) && ends_word(text, at + word.size())) return true;
    }
    for (const std::string_view word : {"T", "O", "R", "discount", "values", "states", "actions", "observations", "start"}) {
        if (!starts_with(text, at, word)) continue;
        std::size_t next = at + word.size();
        while (next < text.size() && is_space(text[next])) ++next;
        if (next < text.size() && text[next] == ':') return true;
    }
    return false;
}

// The number at an offset, which must end as a word, or before a keyword; returns the offset of the next token, npos if it
// is not a number. A sign is a token of its own: white space and comments may follow it.
std::size_t take_number(std::string_view text, std::size_t at, double& value) {
    bool negative = false;
    if (at < text.size() && (text[at] == '-' || text[at] == '+')) {
        negative = text[at] == '-';
        at = skip(text, at + 1);
        if (at < text.size() && (text[at] == '-' || text[at] == '+')) return kNotFound;
    }
    const std::size_t end = parse_number(text, at, value);
    if (end == kNotFound || !std::isfinite(value) || !(ends_word(text, end) || is_keyword(text, end))) return kNotFound;
    if (negative) value = -value;
    return skip(text, end);
}

class Scanner {
  public:
    Scanner(std::string_view text, const Names& actions, const Names& states, const Names& observations, const ScanOptions& options)
        : text_(text), options_(options), names_{&actions, &states, &observations} {
        found_.reward.references = options.reward_references;
    }

    PlainStatements scan(std::size_t at) {
        found_.end = at;
        while (numbers_ < options_.max_numbers && at < text_.size()) {
            at = scan_statement(at);
            if (at == kNotFound) break;
            found_.end = at;
        }
        return std::move(found_);
    }

  private:
    // The last word of a reference and its index: words often repeat.
    struct Known {
        const Names* names = nullptr;
        std::string_view word;
        std::int32_t index = 0;
    };

    bool find(std::size_t reference, const Names& names, std::string_view word, std::int32_t& index) {
        Known& known = known_[reference];
        if (known.names != &names || known.word != word) {
            if (!names.find(word, index)) return false;
            known = {&names, word, index};
        }
        index = known.index;
        return true;
    }

    // Returns the offset of the next statement, npos if this one is not plain.
    std::size_t scan_statement(std::size_t at) {
        const char keyword = text_[at];
        if (keyword != 'T' && keyword != 'O' && keyword != 'R') return kNotFound;
        PlainTable& table = keyword == 'T' ? found_.transition : keyword == 'O' ? found_.observation : found_.reward;
        const Names* kinds[4] = {names_[0], names_[1], keyword == 'O' ? names_[2] : names_[1], names_[2]};
        std::int32_t indices[4];
        at = skip(text_, at + 1);
        std::size_t count = 0;
        for (; count < table.references && at < text_.size() && text_[at] == ':'; ++count) {
            const std::size_t begin = skip(text_, at + 1), end = find_word_end(text_, begin);
            if (end == begin || !find(count, *kinds[count], text_.substr(begin, end - begin), indices[count])) return kNotFound;
            at = skip(text_, end);
        }
        if (count == table.references) return scan_entry(keyword, table, indices, at);
        return count == 2 && keyword != 'R' ? scan_row(keyword, table, indices, at) : kNotFound;
    }

    std::size_t scan_entry(char keyword, PlainTable& table, const std::int32_t* indices, std::size_t at) {
        if (keyword != 'R' && indices[2] < 0) return kNotFound;  // sets a whole row
        if (at < text_.size() && text_[at] == ':') {
            if (keyword == 'R' && table.references == 3) return kNotFound;  // possibly an observation of an MDP
            at = skip(text_, at + 1);                                       // a stray colon of published files
        }
        double value = 0.0;
        const std::size_t next = take_number(text_, at, value);
        if (next == kNotFound || (keyword != 'R' && !(value >= 0 && value <= options_.max_probability))) return kNotFound;
        table.entry_indices.insert(table.entry_indices.end(), indices, indices + table.references);
        table.entry_values.push_back(value);
        table.entry_offsets.push_back(static_cast<std::int64_t>(at));
        ++numbers_;
        return next;
    }

    std::size_t scan_row(char keyword, PlainTable& table, const std::int32_t* indices, std::size_t at) {
        const std::size_t before = table.row_columns.size(), count = keyword == 'T' ? options_.states : options_.observations;
        const std::size_t next = scan_numbers(text_, at, count, table.row_columns, table.row_values);
        bool plain = next != kNotFound;
        for (std::size_t i = before; i < table.row_values.size(); ++i) {
            plain = plain && table.row_values[i] >= 0 && table.row_values[i] <= options_.max_probability;
        }
        if (!plain) {
            table.row_columns.resize(before);
            table.row_values.resize(before);
            return kNotFound;
        }
        table.row_indices.insert(table.row_indices.end(), indices, indices + 2);
        table.row_offsets.push_back(static_cast<std::int64_t>(at));
        table.row_begins.push_back(static_cast<std::int64_t>(table.row_columns.size()));
        numbers_ += count;
        return next;
    }

    std::string_view text_;
    const ScanOptions options_;
    const Names* names_[3];
    Known known_[4];
    std::size_t numbers_ = 0;
    PlainStatements found_;
};

}  // namespace

void Names::add(std::string name, std::int32_t index) {
    texts_.push_back(std::move(name));
    index_[texts_.back()] = index;
}

bool Names::find(std::string_view name, std::int32_t& index) const {
    const auto entry = index_.find(name);
    if (entry == index_.end()) return false;
    index = entry->second;
    return true;
}

PlainStatements scan_statements(std::string_view text, std::size_t offset, const Names& actions, const Names& states,
                                const Names& observations, const ScanOptions& options) {
    return Scanner(text, actions, states, observations, options).scan(offset);
}

std::size_t scan_numbers(std::string_view text, std::size_t offset, std::size_t count, std::vector<std::int32_t>& columns,
                         std::vector<double>& values) {
    for (std::size_t i = 0; i < count; ++i) {
        double value = 0.0;
        offset = take_number(text, offset, value);
        if (offset == kNotFound) return kNotFound;
        if (value == 0.0) continue;
        columns.push_back(static_cast<std::int32_t>(i));
        values.push_back(value);
    }
    return offset;
}

}  // namespace lcorpp
