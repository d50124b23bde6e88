// Sums of products of tables over all but some variables, along an elimination order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include "number.hpp"
#include "loop_nest.hpp"
#include "order.hpp"
#include "reorder.hpp"

namespace lcorpp {

// The tables of a network. A table has an entry for each combination of values of its scope, the last variable fastest.
struct Network {
    std::vector<int> sizes;                 // of the variables
    std::vector<std::vector<int>> scopes;   // of the tables
    std::vector<std::vector<double>> tables;
    // The variable of which a table is the distribution given the others of its scope, -1 for other tables. The tables
    // of variables on which nothing depends are left out.
    std::vector<int> children;
    std::vector<double> lowest;  // the logarithm of the smallest positive entry of each table
};

// What is asked: the joint weights of the kept variables, or the marginals of all variables.
struct Question {
    std::vector<int> kept;
    std::vector<int> observed;  // their values are given by each evidence
    std::vector<int> weighted;  // each evidence gives weights for their values
    bool marginals = false;     // of all variables; then none is kept
};

// One evidence: the values of the observed variables, and the weights of the weighted ones one after the other.
struct Evidence {
    const std::int64_t* values;
    const double* weights;
};

// The tables and messages of one type of numbers.
template <typename T>
struct Numbers {
    std::vector<std::vector<T>> tables;  // empty for floating point, which uses those of the network
    std::vector<std::vector<T>> messages;
    std::vector<T> written;  // a message before it is reordered
    std::vector<double> logarithms;      // of the factors by which messages are scaled
    std::vector<double> lowest;          // as of tables, of messages
};

// The steps that answer a question. The result of step i, a message, is the sum over its variable.
class Plan {
  public:
    Plan(std::shared_ptr<const Network> network, Question question);

    double cost() const { return cost_; }    // multiplications, about
    double width() const { return width_; }  // bits of the largest clique
    double memory() const { return memory_; }  // bytes of all messages together
    std::size_t result_size() const { return result_size_; }
    const std::vector<int>& order() const { return order_; }    // of the variables that are summed out
    const std::vector<int>& tables() const { return tables_; }  // those that are read

    // Compute the messages that are the same for all evidence. `check` is called from time to time, and may throw.
    template <typename Check>
    void prepare(Check& check) {
        prepare_all<double>(numbers_, check);
        is_prepared_ = true;
    }

    // Write the weights of the question, scaled to a maximum of 1, all 0 if the evidence is impossible; return the
    // logarithm of their scale. Weights of marginals follow each other in the order of the variables; each is scaled.
    template <typename Check>
    double evaluate(const Evidence& evidence, double* result, Check& check) {
        if (steps_.empty()) throw std::length_error("the tables are too large");
        if (!is_prepared_) prepare(check);
        bool is_extreme = is_extreme_;
        double logarithm = 0.0;
        if (!is_extreme) logarithm = run<double>(numbers_, evidence, result, is_extreme, check);
        if (is_extreme) {
            if (!has_wide_) prepare_all<WideNumber>(wide_, check);
            has_wide_ = true;
            bool ignored = false;
            logarithm = run<WideNumber>(wide_, evidence, result, ignored, check);
        }
        return logarithm;
    }

  private:
    enum class Kind { table, message, weights, derivative };
    struct Operand {
        Kind kind;
        int index;
        std::vector<int> scope;
        std::vector<Offset> strides;                        // by variable of the scope
        std::vector<std::pair<int, Offset>> observed;       // index of an observed variable, and its stride
    };
    struct Step {
        int variable;  // -1 for the last step
        std::vector<int> scope;  // of the message
        std::vector<Operand> operands;
        std::size_t size;  // of the message
        bool is_static;    // whether it is the same for all evidence; its scope may have observed variables
        bool is_copied = false;  // whether `nest` writes the message in another order, and `copy` reorders it
        Reorder copy;
        // LoopNest has no state but its shape, so floating-point and wide numbers each have their own
        LoopNest<double> nest;
        LoopNest<WideNumber> wide_nest;
    };

    // Which operands of a step have a variable, as a number and as bits, and its place in the scope of the message.
    struct Use {
        int users = 0;
        std::uint64_t signature = 0;
        int place = -1;
    };

    bool can_open(const Step& step, const std::vector<bool>& is_fixed, double& open_work) const;
    void fix_observed(Step& step, const std::vector<int>& observed_index) const;
    void arrange_messages(Step& step, std::vector<Use>& uses);
    void arrange_loops(Step& step);
    std::vector<Offset> list_strides(const std::vector<int>& scope) const;
    std::vector<bool> find_needed(const std::vector<bool>& is_fixed) const;
    template <typename T>
    LoopNest<T> make_nest(const Step& step, const std::vector<int>& out, const std::vector<const Operand*>& operands) const;

    template <typename T>
    const T* locate(const Numbers<T>& numbers, const Operand& operand, const Evidence* evidence,
                    const std::vector<T>& weights) const;
    template <typename T>
    static const LoopNest<T>& get_nest(const Step& step);
    template <typename T, typename Check>
    bool compute(Numbers<T>& numbers, std::size_t step, const Evidence* evidence, const std::vector<T>& weights,
                 std::vector<T>& buffer, Check& check);
    template <typename T>
    static void scale(std::vector<T>& numbers, double& logarithm, double& lowest);
    template <typename T>
    void release_messages(Numbers<T>& numbers, const Step& step, bool is_static) const;
    template <typename T, typename Check>
    void prepare_all(Numbers<T>& numbers, Check& check);
    template <typename T, typename Check>
    double run(Numbers<T>& numbers, const Evidence& evidence, double* result, bool& is_extreme, Check& check);
    template <typename T>
    std::vector<std::vector<T>> multiply_others(const Numbers<T>& numbers, const Step& step, const Operand& own,
                                                const std::vector<T>& derivative, const Evidence& evidence,
                                                const std::vector<T>& weights) const;
    Operand make_clique(const Step& step) const;
    template <typename T, typename Check>
    bool derive(Numbers<T>& numbers, const Evidence& evidence, const std::vector<T>& weights, double* result,
                Check& check);

    std::shared_ptr<const Network> network_;
    Question question_;
    std::vector<Step> steps_;
    std::vector<int> order_, tables_;
    std::vector<Offset> weight_offsets_;  // of each weighted variable among the weights of an evidence
    std::size_t n_weights_ = 0, result_size_ = 0;
    double cost_ = 0.0, width_ = 0.0, memory_ = 0.0;
    Numbers<double> numbers_;
    Numbers<WideNumber> wide_;
    double lowest_weight_ = 0.0;  // the logarithm of the smallest positive weight of the evidence
    bool is_prepared_ = false, has_wide_ = false, is_extreme_ = false;
};

}  // namespace lcorpp

#include "network_passes.hpp"
