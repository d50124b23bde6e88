// What the files of the bindings share.
#pragma once

#include <nanobind/nanobind.h>

namespace lcorpp {

namespace nb = nanobind;

// Raises KeyboardInterrupt after Ctrl-C.
inline void check_interrupt() {
    nb::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
}

void bind_tree(nb::module_& m);

}  // namespace lcorpp
