#include "reachable_blocks.hpp"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <unordered_map>
#include <utility>

namespace lcorpp {

namespace {

class Blocks {
  public:
    explicit Blocks(const Model& model)
        : model_(model),
          parent_(as_size(model.states)),
          size_(as_size(model.states), 1),
          reached_(as_size(model.states), 0),
          processed_(as_size(model.states), 0),
          successors_(as_size(model.states)) {
        std::iota(parent_.begin(), parent_.end(), 0);
    }

    Index find(Index s) {
        while (parent_[as_size(s)] != s) {
            Index& up = parent_[as_size(s)];
            up = parent_[as_size(up)];
            s = up;
        }
        return s;
    }

    void reach(Index s) {
        if (reached_[as_size(s)]) return;
        reached_[as_size(s)] = 1;
        queue_.push_back(s);
    }

    bool is_reached(Index s) const { return reached_[as_size(s)]; }

    // Merge the successors of some states that the same action and observation reach.
    void merge_successors(const std::vector<Index>& states) {
        Table table;
        for (const Index s : states) add_successors(s, table);
        merge_pending();
    }

    // Process all states that are reached, also those that become so.
    void close() {
        for (; next_ < queue_.size(); ++next_) {
            const Index s = queue_[next_], block = find(s);
            // The table of a block of one state is filled only if the block grows: most such blocks never do.
            Table own;
            add_successors(s, size_[as_size(block)] == 1 ? own : successors_[as_size(block)]);
            processed_[as_size(s)] = 1;
            merge_pending();
        }
    }

  private:
    // One state of the next block, by action and observation.
    using Table = std::unordered_map<std::uint64_t, Index>;

    void add(Table& table, std::uint64_t key, Index s) {
        const auto [entry, is_new] = table.emplace(key, s);
        if (!is_new && entry->second != s) pending_.emplace_back(entry->second, s);
    }

    void add_successors(Index s, Table& table) {
        const SparseTables& T = model_.transition;
        const SparseTables& Z = model_.observation;
        for (Index a = 0; a < model_.actions; ++a) {
            for (std::size_t i = T.begin(a, s); i < T.end(a, s); ++i) {
                const Index next = T.column[i];
                reach(next);
                for (std::size_t j = Z.begin(a, next); j < Z.end(a, next); ++j) {
                    add(table, static_cast<std::uint64_t>(a) * as_size(model_.observations) + as_size(Z.column[j]), next);
                }
            }
        }
    }

    void merge_pending() {
        while (!pending_.empty()) {
            const auto [a, b] = pending_.back();
            pending_.pop_back();
            Index large = find(a), small = find(b);
            if (large == small) continue;
            for (const Index block : {large, small}) {
                if (size_[as_size(block)] == 1 && processed_[as_size(block)]) add_successors(block, successors_[as_size(block)]);
            }
            if (successors_[as_size(large)].size() < successors_[as_size(small)].size()) std::swap(large, small);
            Table moved;
            moved.swap(successors_[as_size(small)]);
            for (const auto& [key, s] : moved) add(successors_[as_size(large)], key, s);
            parent_[as_size(small)] = large;
            size_[as_size(large)] += size_[as_size(small)];
        }
    }

    const Model& model_;
    std::vector<Index> parent_, size_;
    std::vector<char> reached_, processed_;
    std::vector<Table> successors_;
    std::vector<std::pair<Index, Index>> pending_;  // states of blocks that must be merged
    std::vector<Index> queue_;                      // reached states
    std::size_t next_ = 0;                          // first state of the queue that is not processed
};

}  // namespace

std::vector<Index> find_reachable_blocks(const Model& model, const std::vector<std::vector<Index>>& starts) {
    Blocks blocks(model);
    for (const auto& start : starts) {
        for (const Index s : start) blocks.reach(s);
        blocks.merge_successors(start);
    }
    blocks.close();
    std::vector<Index> spread;  // all states of the starts over several blocks: they share their alpha vectors
    for (const auto& start : starts) {
        const bool within = std::all_of(start.begin(), start.end(), [&](Index s) { return blocks.find(s) == blocks.find(start[0]); });
        if (!within) spread.insert(spread.end(), start.begin(), start.end());
    }
    blocks.merge_successors(spread);
    std::vector<Index> block(as_size(model.states), -1), number(as_size(model.states), -1);
    Index count = 0;
    for (Index s = 0; s < model.states; ++s) {
        if (!blocks.is_reached(s)) continue;
        Index& own = number[as_size(blocks.find(s))];
        if (own < 0) own = count++;
        block[as_size(s)] = own;
    }
    return block;
}

}  // namespace lcorpp
