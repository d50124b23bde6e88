#include "order.hpp"

#include <cmath>
#include <limits>

#ifdef _MSC_VER
#include <intrin.h>
#endif

namespace lcorpp {

namespace {

int count_ones(std::uint64_t bits) {
#ifdef _MSC_VER
    return static_cast<int>(__popcnt64(bits));
#else
    return __builtin_popcountll(bits);
#endif
}

int find_lowest(std::uint64_t bits) {
#ifdef _MSC_VER
    unsigned long index;
    _BitScanForward64(&index, bits);
    return static_cast<int>(index);
#else
    return __builtin_ctzll(bits);
#endif
}

// Source: Kjaerulff, "Triangulation of graphs: algorithms giving small total state space", 1990 (the criteria); Fishelson
// and Geiger, "Optimizing exact genetic linkage computations", J. Comp. Biology 11, 2004 (random choices).
enum class Criterion { fill, weight, weighted_fill };

constexpr double restart_share = 0.2;  // of the cost of the contraction, for the work of restarts
constexpr int max_restarts = 60;

class Random {
  public:
    explicit Random(std::uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15ULL + 1) {}
    double uniform() {
        state_ ^= state_ << 13;
        state_ ^= state_ >> 7;
        state_ ^= state_ << 17;
        return static_cast<double>(state_ >> 11) * 0x1.0p-53;
    }

  private:
    std::uint64_t state_;
};

// The graph of variables that share a table, as rows of bits.
class Graph {
  public:
    Graph(const std::vector<double>& bits, const std::vector<std::vector<int>>& scopes)
        : n_(bits.size()), words_((n_ + 63) / 64), rows_(n_ * words_), bits_(bits) {
        for (const auto& scope : scopes) {
            for (const int a : scope) {
                for (const int b : scope) {
                    if (a != b) set(a, b);
                }
            }
        }
    }

    std::vector<int> list_neighbours(int v) const {
        std::vector<int> result;
        const std::uint64_t* own = row(v);
        for (std::size_t w = 0; w < words_; ++w) {
            for (std::uint64_t left = own[w]; left; left &= left - 1) {
                result.push_back(static_cast<int>(w * 64) + find_lowest(left));
            }
        }
        return result;
    }

    double weigh_clique(int v, const std::vector<int>& neighbours) const {
        double total = bits_[v];
        for (const int u : neighbours) total += bits_[u];
        return total;
    }

    double rate(int v, const std::vector<int>& neighbours, Criterion criterion) const {
        if (criterion == Criterion::weight) return weigh_clique(v, neighbours);
        double total = 0.0;
        const std::uint64_t* own = row(v);
        for (const int u : neighbours) {
            const std::uint64_t* other = row(u);
            for (std::size_t w = 0; w < words_; ++w) {
                std::uint64_t missing = own[w] & ~other[w];
                if (criterion == Criterion::fill) {
                    total += count_ones(missing);
                } else {
                    for (; missing; missing &= missing - 1) {
                        total += bits_[u] * bits_[w * 64 + static_cast<std::size_t>(find_lowest(missing))];
                    }
                }
            }
            if (criterion == Criterion::fill) {
                total -= 1.0;  // u itself
            } else {
                total -= bits_[u] * bits_[u];
            }
        }
        return total;
    }

    // Connect the neighbours of a variable and remove it; return whether edges were added.
    bool eliminate(int v, const std::vector<int>& neighbours) {
        bool added = false;
        const std::uint64_t* own = row(v);
        for (const int u : neighbours) {
            std::uint64_t* other = row(u);
            for (std::size_t w = 0; w < words_; ++w) {
                std::uint64_t missing = own[w] & ~other[w];
                if (w == static_cast<std::size_t>(u) / 64) missing &= ~(1ULL << (u % 64));
                added |= missing != 0;
                other[w] |= missing;
            }
            other[static_cast<std::size_t>(v) / 64] &= ~(1ULL << (v % 64));
        }
        return added;
    }

    std::size_t words() const { return words_; }

  private:
    const std::uint64_t* row(int v) const { return rows_.data() + static_cast<std::size_t>(v) * words_; }
    std::uint64_t* row(int v) { return rows_.data() + static_cast<std::size_t>(v) * words_; }
    void set(int a, int b) { row(a)[static_cast<std::size_t>(b) / 64] |= 1ULL << (b % 64); }

    std::size_t n_, words_;
    std::vector<std::uint64_t> rows_;
    const std::vector<double>& bits_;
};

// Eliminate greedily; end early if the cost reaches a limit. `work` counts operations.
EliminationOrder eliminate(Graph graph, const std::vector<bool>& is_kept, const std::vector<bool>& is_present,
                           Criterion criterion, Random* random, double limit, double& work) {
    const std::size_t n = is_kept.size();
    std::vector<double> rating(n, 0.0);
    std::vector<bool> is_outdated(n, true);
    std::vector<int> left;
    for (std::size_t v = 0; v < n; ++v) {
        if (is_present[v] && !is_kept[v]) left.push_back(static_cast<int>(v));
    }
    EliminationOrder order;
    while (!left.empty()) {
        std::size_t best = 0;
        double lowest = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < left.size(); ++i) {
            const int v = left[i];
            if (is_outdated[v]) {
                const auto neighbours = graph.list_neighbours(v);
                rating[v] = graph.rate(v, neighbours, criterion);
                if (criterion != Criterion::weight) work += static_cast<double>(neighbours.size() * graph.words());
                is_outdated[v] = false;
            }
            double value = rating[v];
            if (random && value > 0.0) value *= 1.0 + 0.3 * random->uniform();
            if (value < lowest) {
                lowest = value;
                best = i;
            }
        }
        work += static_cast<double>(left.size());
        const int v = left[best];
        left[best] = left.back();
        left.pop_back();
        const auto neighbours = graph.list_neighbours(v);
        const double bits = graph.weigh_clique(v, neighbours);
        order.variables.push_back(v);
        order.cost += std::exp2(bits);
        order.width = std::max(order.width, bits);
        if (order.cost >= limit) return order;
        const bool added = graph.eliminate(v, neighbours);
        work += static_cast<double>(neighbours.size() * graph.words());
        for (const int u : neighbours) {
            is_outdated[u] = true;
            if (!added || criterion == Criterion::weight) continue;
            for (const int w : graph.list_neighbours(u)) is_outdated[w] = true;
        }
    }
    return order;
}

}  // namespace

EliminationOrder find_order(const std::vector<int>& sizes, const std::vector<std::vector<int>>& scopes,
                            const std::vector<bool>& is_kept) {
    std::vector<double> bits;
    for (const int size : sizes) bits.push_back(std::log2(static_cast<double>(size)));
    std::vector<bool> is_present(sizes.size(), false);
    for (const auto& scope : scopes) {
        for (const int v : scope) is_present[v] = true;
    }
    const Graph graph(bits, scopes);
    double work = 0.0;
    EliminationOrder best =
        eliminate(graph, is_kept, is_present, Criterion::fill, nullptr, max_cost, work);
    const auto improve = [&](Criterion criterion, Random* random) {
        const EliminationOrder other = eliminate(graph, is_kept, is_present, criterion, random, best.cost, work);
        if (other.cost < best.cost) best = other;  // of those that were given up, too: the limit is the cost so far
    };
    if (best.cost < 4.0 * work) return best;  // the contraction takes no longer than another order
    improve(Criterion::weight, nullptr);
    improve(Criterion::weighted_fill, nullptr);
    work = 0.0;
    for (int restart = 0; restart < max_restarts && work < restart_share * best.cost; ++restart) {
        Random random(static_cast<std::uint64_t>(restart) + 1);
        improve(restart % 2 ? Criterion::weighted_fill : Criterion::fill, &random);
    }
    return best;
}

}  // namespace lcorpp
