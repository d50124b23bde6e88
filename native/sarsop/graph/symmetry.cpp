#include "graph/symmetry.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <utility>

namespace lcorpp {

namespace {

using Color = std::uint64_t;
using Colors = std::vector<Color>;

// Numbers that differ by less than this share of the largest are equal.
constexpr double kEqualShare = 1e-12;

// Cells of vertices with one colour that are larger are not searched for exchanges.
constexpr std::size_t kMaxCell = 64;

// Largest number of conjugates of renamings that move as many states.
constexpr std::size_t kMaxConjugates = 300;

// Images that are tried for one vertex.
constexpr std::size_t kMaxImages = 4;

// The finaliser of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
Color mix(Color x) {
    x += 0x9E3779B97F4A7C15ull;
    x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ull;
    x = (x ^ (x >> 27)) * 0x94D049BB133111EBull;
    return x ^ (x >> 31);
}

// A number of a table with the vertices that it belongs to: action, state, and next state or observation or again the state.
struct Entry {
    std::size_t vertices[3];
    Color value;
};

class Finder {
  public:
    Finder(const Model& model, std::size_t max_refinements, Clock& clock)
        : model_(model), S_(as_size(model.states)), A_(as_size(model.actions)), size_(S_ + A_ + as_size(model.observations)),
          left_(max_refinements), clock_(clock), joined_(size_) {
        for (std::size_t v = 0; v < size_; ++v) joined_[v] = v;
        double largest = 0.0;
        for (const double reward : model.reward) largest = std::max(largest, std::abs(reward));
        if (largest == 0.0) largest = 1.0;
        scale_ = 1.0 / (kEqualShare * largest);
        for (std::size_t a = 0; a < A_; ++a) {
            for (std::size_t s = 0; s < S_; ++s) {
                const auto action = static_cast<Index>(a), state = static_cast<Index>(s);
                add(a, s, s, model.reward_of(action, state) / largest, 1);
                const SparseTables& T = model.transition;
                for (std::size_t i = T.begin(action, state); i < T.end(action, state); ++i) add(a, s, as_size(T.column[i]), T.value[i], 2);
                const SparseTables& Z = model.observation;
                for (std::size_t i = Z.begin(action, state); i < Z.end(action, state); ++i) {
                    add(a, s, S_ + A_ + as_size(Z.column[i]), Z.value[i], 3);
                }
            }
        }
    }

    std::vector<std::vector<Index>> find() {
        Colors colors(size_);
        for (std::size_t v = 0; v < size_; ++v) colors[v] = v < S_ ? 1 : v < S_ + A_ ? 2 : 3;
        refine(colors);
        std::vector<std::vector<std::size_t>> cells;
        std::map<Color, std::vector<std::size_t>> by_color;
        for (std::size_t v = 0; v < size_; ++v) by_color[colors[v]].push_back(v);
        for (auto& [color, cell] : by_color) {
            if (cell.size() > 1 && cell.size() <= kMaxCell) cells.push_back(std::move(cell));
        }
        std::stable_sort(cells.begin(), cells.end(), [](const auto& a, const auto& b) {
            return a.size() != b.size() ? a.size() < b.size() : a.front() < b.front();
        });
        for (const auto& cell : cells) {
            for (std::size_t i = 0; i < cell.size(); ++i) {
                for (std::size_t j = i + 1; j < cell.size(); ++j) {
                    if (left_ == 0 || clock_.expired()) return close();
                    if (find_root(cell[i]) == find_root(cell[j])) continue;  // a product of renamings maps them
                    Colors source = colors, target = colors;
                    fix(source, cell[i], 1);
                    fix(target, cell[j], 1);
                    fix(source, cell[j], 2);  // an exchange, if there is one
                    fix(target, cell[i], 2);
                    extend(std::move(source), std::move(target), 3);
                }
            }
        }
        return close();
    }

  private:
    void add(std::size_t action, std::size_t state, std::size_t third, double value, Color kind) {
        entries_.push_back({{S_ + action, state, third}, mix(static_cast<Color>(std::llround(value / kEqualShare / 1e3)) * 4 + kind)});
    }

    static void fix(Colors& colors, std::size_t vertex, Color number) { colors[vertex] = mix(colors[vertex] ^ mix(number + 1000)); }

    void refine(Colors& colors) {
        std::size_t known = count(colors);
        Colors signature(size_);
        while (left_ > 0) {
            --left_;
            std::fill(signature.begin(), signature.end(), 0);
            for (const Entry& entry : entries_) {
                const Color hash = mix(mix(mix(entry.value ^ colors[entry.vertices[0]]) ^ colors[entry.vertices[1]]) ^ colors[entry.vertices[2]]);
                for (std::size_t k = 0; k < 3; ++k) signature[entry.vertices[k]] += mix(hash + k);
            }
            for (std::size_t v = 0; v < size_; ++v) colors[v] = mix(colors[v] ^ mix(signature[v]));
            const std::size_t now = count(colors);
            if (now == known) return;
            known = now;
        }
    }

    static std::size_t count(Colors colors) {
        std::sort(colors.begin(), colors.end());
        return static_cast<std::size_t>(std::unique(colors.begin(), colors.end()) - colors.begin());
    }

    // Extend two colourings to a renaming of the first into the second.
    bool extend(Colors source, Colors target, Color number) {
        if (left_ == 0) return false;
        refine(source);
        refine(target);
        std::map<Color, std::vector<std::size_t>> sources, targets;
        for (std::size_t v = 0; v < size_; ++v) {
            sources[source[v]].push_back(v);
            targets[target[v]].push_back(v);
        }
        const std::vector<std::size_t>* open = nullptr;
        for (const auto& [color, cell] : sources) {
            const auto image = targets.find(color);
            if (image == targets.end() || image->second.size() != cell.size()) return false;
            if (cell.size() > 1 && (!open || cell.size() < open->size() || (cell.size() == open->size() && cell < *open))) open = &cell;
        }
        if (!open) {
            std::vector<std::size_t> image(size_);
            for (const auto& [color, cell] : sources) image[cell[0]] = targets[color][0];
            return accept(image);
        }
        // Where values are exchanged, the others are their own images, and the combinations with both have the same order.
        std::vector<std::size_t> guess(size_, size_);
        for (const auto& [color, cell] : sources) {
            std::vector<std::size_t> images = targets[color], left;
            for (const std::size_t v : cell) {
                const auto own = std::find(images.begin(), images.end(), v);
                if (own == images.end()) {
                    left.push_back(v);
                } else {
                    guess[v] = v;
                    images.erase(own);
                }
            }
            for (std::size_t i = 0; i < left.size(); ++i) guess[left[i]] = images[i];
        }
        if (accept(guess)) return true;
        const std::size_t vertex = open->front();
        std::vector<std::size_t> images = targets[source[vertex]];
        const auto own = std::find(images.begin(), images.end(), vertex);
        if (own != images.end()) std::rotate(images.begin(), own, own + 1);  // as few vertices as possible are renamed
        for (std::size_t i = 0; i < images.size() && i < kMaxImages; ++i) {
            Colors next_source = source, next_target = target;
            fix(next_source, vertex, number);
            fix(next_target, images[i], number);
            if (extend(std::move(next_source), std::move(next_target), number + 1)) return true;
        }
        return false;
    }

    // Compare the renamed model with the model.
    bool accept(const std::vector<std::size_t>& image) {
        const auto to = [&](std::size_t v) { return static_cast<Index>(v < S_ ? image[v] : v < S_ + A_ ? image[v] - S_ : image[v] - S_ - A_); };
        for (std::size_t v = 0; v < size_; ++v) {
            const bool same_kind = v < S_ ? image[v] < S_ : v < S_ + A_ ? image[v] >= S_ && image[v] < S_ + A_ : image[v] >= S_ + A_;
            if (!same_kind) return false;
        }
        for (std::size_t a = 0; a < A_; ++a) {
            const Index action = static_cast<Index>(a), to_action = to(S_ + a);
            for (std::size_t s = 0; s < S_; ++s) {
                const Index state = static_cast<Index>(s), to_state = to(s);
                if (std::abs(model_.reward_of(action, state) - model_.reward_of(to_action, to_state)) * scale_ > 1) return false;
                if (!same_row(model_.transition, action, state, to_action, to_state, [&](Index x) { return to(as_size(x)); })) return false;
                if (!same_row(model_.observation, action, state, to_action, to_state, [&](Index o) { return to(S_ + A_ + as_size(o)); })) return false;
            }
        }
        std::vector<Index> states(S_);
        bool moves = false;
        for (std::size_t s = 0; s < S_; ++s) {
            states[image[s]] = static_cast<Index>(s);  // the image takes the weight of s
            moves = moves || image[s] != s;
        }
        if (moves) found_.insert(std::move(states));
        for (std::size_t v = 0; v < size_; ++v) join(v, image[v]);
        return true;
    }

    template <typename To>
    bool same_row(const SparseTables& table, Index action, Index state, Index to_action, Index to_state, To to) {
        row_.clear();
        for (std::size_t i = table.begin(to_action, to_state); i < table.end(to_action, to_state); ++i) row_.emplace_back(table.column[i], table.value[i]);
        other_.clear();
        for (std::size_t i = table.begin(action, state); i < table.end(action, state); ++i) other_.emplace_back(to(table.column[i]), table.value[i]);
        if (row_.size() != other_.size()) return false;
        std::sort(row_.begin(), row_.end());
        std::sort(other_.begin(), other_.end());
        for (std::size_t i = 0; i < row_.size(); ++i) {
            if (row_[i].first != other_[i].first || std::abs(row_[i].second - other_[i].second) > kEqualShare) return false;
        }
        return true;
    }

    // Vertices that the renamings found so far map to each other are joined.
    std::size_t find_root(std::size_t v) {
        while (joined_[v] != v) v = joined_[v] = joined_[joined_[v]];
        return v;
    }
    void join(std::size_t v, std::size_t w) { joined_[find_root(v)] = find_root(w); }

    // The renamings that were found, and their conjugates: where one exchanges two values and others map them to further
    // ones, all exchanges. Classes of conjugates that are too large are left as they were found.
    std::vector<std::vector<Index>> close() const {
        std::map<std::size_t, std::set<std::vector<Index>>> classes;
        for (const std::vector<Index>& image : found_) {
            std::size_t moved = 0;
            for (std::size_t s = 0; s < S_; ++s) moved += as_size(image[s]) != s;
            classes[moved].insert(image);
        }
        std::vector<std::vector<Index>> result;
        std::vector<Index> conjugate(S_);
        for (const auto& [moved, own] : classes) {
            std::set<std::vector<Index>> all = own;
            std::vector<std::vector<Index>> open(own.begin(), own.end());
            while (!open.empty() && all.size() <= kMaxConjugates) {
                const std::vector<Index> image = std::move(open.back());
                open.pop_back();
                for (const std::vector<Index>& by : found_) {
                    for (std::size_t s = 0; s < S_; ++s) conjugate[as_size(by[s])] = by[as_size(image[s])];
                    if (all.insert(conjugate).second) open.push_back(conjugate);
                }
            }
            const std::set<std::vector<Index>>& kept = all.size() <= kMaxConjugates ? all : own;
            result.insert(result.end(), kept.begin(), kept.end());
        }
        return result;
    }

    const Model& model_;
    const std::size_t S_, A_, size_;
    std::size_t left_;
    Clock& clock_;
    double scale_;
    std::vector<std::size_t> joined_;
    std::vector<Entry> entries_;
    std::set<std::vector<Index>> found_;
    std::vector<std::pair<Index, double>> row_, other_;  // reusable memory
};

}  // namespace

std::vector<std::vector<Index>> find_symmetries(const Model& model, std::size_t max_refinements, Clock& clock) {
    return Finder(model, max_refinements, clock).find();
}

}  // namespace lcorpp
