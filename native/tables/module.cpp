// Python bindings: lcorpp.reasoning.factors._tables. `make stubs` writes the stub from them.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <stdexcept>

#include "arrays.hpp"
#include "interrupt.hpp"
#include "network.hpp"

using namespace lcorpp;
using namespace nb::literals;

namespace {

using Table = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Values = nb::ndarray<const std::int64_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Weights = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

void check_variables(const Network& network, const std::vector<int>& variables) {
    for (const int v : variables) {
        if (v < 0 || static_cast<std::size_t>(v) >= network.sizes.size()) {
            throw std::invalid_argument("a variable that the network does not have");
        }
    }
}

void check_different(std::vector<int> variables) {
    std::sort(variables.begin(), variables.end());
    if (std::adjacent_find(variables.begin(), variables.end()) != variables.end()) {
        throw std::invalid_argument("a variable twice in a scope");
    }
}

// The number of combinations of values, which an integer may not hold.
double count_combinations(const Network& network, const std::vector<int>& variables) {
    double count = 1.0;
    for (const int v : variables) count *= network.sizes[v];
    return count;
}

std::shared_ptr<Network> make_network(std::vector<int> sizes, std::vector<std::vector<int>> scopes,
                                      const std::vector<Table>& tables, std::vector<int> children) {
    auto network = std::make_shared<Network>();
    network->sizes = std::move(sizes);
    network->scopes = std::move(scopes);
    network->children = std::move(children);
    for (const int size : network->sizes) {
        if (size < 1) throw std::invalid_argument("a variable without values");
    }
    for (const int child : network->children) {
        if (child < -1 || child >= static_cast<int>(network->sizes.size())) {
            throw std::invalid_argument("a variable that the network does not have");
        }
    }
    if (network->scopes.size() != tables.size() || network->children.size() != tables.size()) {
        throw std::invalid_argument("expected a scope and a child for each table");
    }
    for (std::size_t i = 0; i < tables.size(); ++i) {
        check_variables(*network, network->scopes[i]);
        check_different(network->scopes[i]);
        const double exact = count_combinations(*network, network->scopes[i]);
        const std::size_t size = tables[i].size();
        if (exact != static_cast<double>(size)) throw std::invalid_argument("a table whose size is not that of its scope");
        network->tables.emplace_back(tables[i].data(), tables[i].data() + size);
        double lowest = 1.0;
        for (const double number : network->tables.back()) lowest = std::min(lowest, number == 0.0 ? lowest : number);
        network->lowest.push_back(std::log(lowest));
    }
    return network;
}

// A plan with what its evidence is checked against.
struct CheckedPlan {
    std::shared_ptr<Network> network;
    Question question;
    std::size_t n_weights = 0;
    std::unique_ptr<Plan> plan;
    std::unique_ptr<std::mutex> mutex = std::make_unique<std::mutex>();  // the messages of a plan belong to one thread
};

auto evaluate(CheckedPlan& own, Values values, Weights weights) {
    Plan& plan = *own.plan;
    const Question& question = own.question;
    const std::size_t n_weights = own.n_weights;
    const std::size_t rows = values.shape(0);
    if (values.shape(1) != question.observed.size() || weights.shape(0) != rows || weights.shape(1) != n_weights) {
        throw std::invalid_argument("evidence of a wrong shape");
    }
    for (std::size_t row = 0; row < rows; ++row) {
        for (std::size_t k = 0; k < question.observed.size(); ++k) {
            const std::int64_t value = values(row, k);
            if (value < 0 || value >= own.network->sizes[question.observed[k]]) throw std::invalid_argument("a value out of range");
        }
    }
    std::vector<double> result(rows * plan.result_size()), logarithms(rows);
    {
        nb::gil_scoped_release unlocked;
        const std::lock_guard<std::mutex> lock(*own.mutex);
        InterruptCheck check;
        for (std::size_t row = 0; row < rows; ++row) {
            const Evidence evidence{values.data() + row * question.observed.size(), weights.data() + row * n_weights};
            logarithms[row] = plan.evaluate(evidence, result.data() + row * plan.result_size(), check);
        }
    }
    const std::size_t size = plan.result_size();
    return std::make_pair(make_array(std::move(result), {rows, size}), make_array(std::move(logarithms)));
}

}  // namespace

NB_MODULE(_tables, m) {
    nb::set_leak_warnings(false);  // a reasoner may live until Python exits
    m.doc() = "Sums of products of tables, for `network.py`. `make stubs` generates the stub.";
    auto plan_class = nb::class_<CheckedPlan>(m, "Plan", "The steps that answer one kind of question.");
    plan_class
        .def_prop_ro("cost", [](const CheckedPlan& own) { return own.plan->cost(); }, "Multiplications, about.")
        .def_prop_ro("width", [](const CheckedPlan& own) { return own.plan->width(); }, "Bits of the largest clique.")
        .def_prop_ro("memory", [](const CheckedPlan& own) { return own.plan->memory(); }, "Bytes of all messages.")
        .def_prop_ro("order", [](const CheckedPlan& own) { return own.plan->order(); }, "The variables that are summed out.")
        .def_prop_ro("tables", [](const CheckedPlan& own) { return own.plan->tables(); }, "The tables that are read.")
        .def(
            "evaluate",
            [](CheckedPlan& own, Values values, Weights weights) {
                auto [result, logarithms] = evaluate(own, values, weights);
                return nb::make_tuple(result, logarithms);
            },
            "values"_a, "weights"_a,
            nb::sig("def evaluate(self, values: NDArray[numpy.int64], weights: NDArray[numpy.float64]) -> "
                    "tuple[NDArray[numpy.float64], NDArray[numpy.float64]]"),
            "Compute weights and the logarithms of their scales, for each row of evidence: values of the observed\n"
            "variables, and weights of the values of the weighted ones.");
    plan_class.def(
        "distribute",
        [](CheckedPlan& own, std::vector<std::int64_t> values) -> nb::object {
            if (own.n_weights || values.size() != own.question.observed.size()) {
                throw std::invalid_argument("evidence of a wrong shape");
            }
            for (std::size_t k = 0; k < values.size(); ++k) {
                if (values[k] < 0 || values[k] >= own.network->sizes[own.question.observed[k]]) {
                    throw std::invalid_argument("a value out of range");
                }
            }
            std::vector<double> result(own.plan->result_size());
            {
                nb::gil_scoped_release unlocked;
                const std::lock_guard<std::mutex> lock(*own.mutex);
                InterruptCheck check;
                own.plan->evaluate({values.data(), nullptr}, result.data(), check);
            }
            double total = 0.0;
            for (const double weight : result) total += weight;
            if (total == 0.0) return nb::none();
            for (double& weight : result) weight /= total;
            return nb::cast(make_array(std::move(result)));
        },
        "values"_a, nb::sig("def distribute(self, values: Sequence[int]) -> NDArray[numpy.float64] | None"),
        "Compute the joint distribution given one value of each observed variable; None if they are impossible.");
    nb::class_<Network>(m, "Network", "Tables over variables.")
        .def(nb::new_(&make_network), "sizes"_a, "scopes"_a, "tables"_a, "children"_a,
             "Args:\n"
             "    sizes: of the variables.\n"
             "    scopes: the variables of each table, the last one fastest.\n"
             "    tables: float64 arrays.\n"
             "    children: the variable whose distribution each table is, -1 for other tables.")
        .def(
            "plan",
            [](std::shared_ptr<Network> network, std::vector<int> kept, std::vector<int> observed,
               std::vector<int> weighted, bool marginals) {
                CheckedPlan own{network, {std::move(kept), std::move(observed), std::move(weighted), marginals}, 0, nullptr};
                check_variables(*network, own.question.kept);
                check_variables(*network, own.question.observed);
                check_variables(*network, own.question.weighted);
                std::vector<int> fixed = own.question.kept;
                fixed.insert(fixed.end(), own.question.observed.begin(), own.question.observed.end());
                check_different(fixed);
                check_different(own.question.weighted);
                if (count_combinations(*network, own.question.kept) > 1e9) {
                    throw std::invalid_argument("too many combinations of the kept variables");
                }
                for (const int v : own.question.weighted) own.n_weights += static_cast<std::size_t>(network->sizes[v]);
                nb::gil_scoped_release unlocked;
                own.plan = std::make_unique<Plan>(network, own.question);
                return own;
            },
            "kept"_a, "observed"_a, "weighted"_a, "marginals"_a = false,
            "Plan how to compute the joint weights of the kept variables, or of every variable apart.");
}
