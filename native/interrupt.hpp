// The user's interrupt in long work.
#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>

namespace lcorpp {

// Lets Python handle an interrupt after each ten million numbers, arcs or entries; with or without the interpreter's lock.
class InterruptCheck {
  public:
    void operator()(std::size_t work) {
        done_ += work;
        if (done_ < 10'000'000) return;
        done_ = 0;
        const nanobind::gil_scoped_acquire locked;
        if (PyErr_CheckSignals() != 0) throw nanobind::python_error();
    }

  private:
    std::size_t done_ = 0;
};

}  // namespace lcorpp
