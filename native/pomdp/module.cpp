// Python bindings: lcorpp.planning.formats.pomdp._scanner. `make stubs` writes the stub from them.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>

#include <stdexcept>
#include <string_view>
#include <tuple>
#include <utility>

#include "arrays.hpp"
#include "scanner.hpp"

using namespace lcorpp;
using namespace nb::literals;

namespace {

// The bytes of an object with the buffer protocol.
class Bytes {
  public:
    explicit Bytes(nb::handle object) {
        if (PyObject_GetBuffer(object.ptr(), &view_, PyBUF_SIMPLE) != 0) throw nb::python_error();
    }
    ~Bytes() { PyBuffer_Release(&view_); }
    Bytes(const Bytes&) = delete;
    Bytes& operator=(const Bytes&) = delete;

    // The bytes, after a check that an offset is within them.
    std::string_view text(std::size_t offset) const {
        const std::string_view text(static_cast<const char*>(view_.buf), static_cast<std::size_t>(view_.len));
        if (offset > text.size()) throw std::invalid_argument("the offset is behind the end of the text");
        return text;
    }

  private:
    Py_buffer view_;
};

auto export_table(PlainTable&& table) {
    const std::size_t entries = table.entry_values.size(), rows = table.row_offsets.size();
    return std::make_tuple(make_array(std::move(table.entry_indices), {entries, table.references}),
                           make_array(std::move(table.entry_values)), make_array(std::move(table.entry_offsets)),
                           make_array(std::move(table.row_indices), {rows, 2}), make_array(std::move(table.row_offsets)),
                           make_array(std::move(table.row_begins)), make_array(std::move(table.row_columns)),
                           make_array(std::move(table.row_values)));
}

}  // namespace

NB_MODULE(_scanner, m) {
    m.doc() = "Plain statements and numbers in .pomdp text, for `tokens.py`. `make stubs` generates the stub.";
    nb::class_<Names>(m, "Names").def(
        "__init__",
        [](Names* self, nb::typed<nb::dict, std::string, int> indices) {
            new (self) Names();
            for (auto [name, index] : indices) self->add(nb::cast<std::string>(name), nb::cast<std::int32_t>(index));
        },
        "indices"_a);
    m.def(
        "scan_statements",
        [](nb::handle text, std::size_t offset, const Names& actions, const Names& states, const Names& observations,
           std::size_t n_states, std::size_t n_observations, std::size_t reward_references, double max_probability,
           std::size_t max_numbers) {
            if (reward_references != 3 && reward_references != 4) throw std::invalid_argument("an entry of R has 3 or 4 references");
            const Bytes bytes(text);
            PlainStatements found = scan_statements(bytes.text(offset), offset, actions, states, observations,
                                                    {max_numbers, max_probability, n_states, n_observations, reward_references});
            return std::make_tuple(found.end, export_table(std::move(found.transition)), export_table(std::move(found.observation)),
                                   export_table(std::move(found.reward)));
        },
        "text"_a, "offset"_a, "actions"_a, "states"_a, "observations"_a, "n_states"_a, "n_observations"_a,
        "reward_references"_a, "max_probability"_a, "max_numbers"_a);
    m.def(
        "scan_rows",
        [](nb::handle text, std::size_t offset, std::size_t rows, std::size_t count) -> nb::object {
            const Bytes bytes(text);
            std::vector<std::int64_t> offsets, begins{0};
            std::vector<std::int32_t> columns;
            std::vector<double> values;
            for (std::size_t row = 0; row < rows; ++row) {
                offsets.push_back(static_cast<std::int64_t>(offset));
                offset = scan_numbers(bytes.text(offset), offset, count, columns, values);
                if (offset == std::string_view::npos) return nb::none();
                begins.push_back(static_cast<std::int64_t>(columns.size()));
            }
            return nb::cast(std::make_tuple(offset, make_array(std::move(offsets)), make_array(std::move(begins)),
                                            make_array(std::move(columns)), make_array(std::move(values))));
        },
        "text"_a, "offset"_a, "rows"_a, "count"_a);
}
