// Orders in which the variables of tables are eliminated.
#pragma once

#include <cstdint>
#include <vector>

namespace lcorpp {

struct EliminationOrder {
    std::vector<int> variables;  // without those that are kept
    double cost = 0.0;           // the entries of all cliques together
    double width = 0.0;          // bits of the largest clique
};

constexpr double max_cost = 1e12;  // an order is given up once it costs more

// Find an order with small cliques: minimum fill, minimum weight and weighted fill, then random choices among nearly
// equal candidates as long as they cost less than the contraction itself.
//
// sizes: of the variables. scopes: the variables of each table. is_kept: whether a variable is not eliminated.
EliminationOrder find_order(const std::vector<int>& sizes, const std::vector<std::vector<int>>& scopes,
                            const std::vector<bool>& is_kept);

}  // namespace lcorpp
