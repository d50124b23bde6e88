// numpy arrays that own the memory of a vector.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <initializer_list>
#include <utility>
#include <vector>

namespace lcorpp {

namespace nb = nanobind;

template <typename T>
using OutputArray = nb::ndarray<nb::numpy, T>;

template <typename T>
OutputArray<T> make_array(std::vector<T> values, std::initializer_list<std::size_t> shape) {
    auto* memory = new std::vector<T>(std::move(values));
    nb::capsule owner(memory, [](void* pointer) noexcept { delete static_cast<std::vector<T>*>(pointer); });
    return OutputArray<T>(memory->data(), shape, owner);
}

template <typename T>
OutputArray<T> make_array(std::vector<T> values) {
    const std::size_t size = values.size();
    return make_array(std::move(values), {size});
}

}  // namespace lcorpp
