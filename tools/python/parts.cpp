// Parts of runs: what limn/parts.py makes and joins them with.
#include "limn/integrators/parts.h"

#include <fmt/format.h>
#include <nanobind/stl/unique_ptr.h>

#include "tools/python/bindings.h"

namespace limn::python {

void bind_parts(nb::module_& m) {
  nb::class_<BatchStore>(m, "BatchStore", "Who makes the batches of a run.");
  nb::class_<PartWriter, BatchStore>(m, "PartWriter", "Makes one part of a run, in memory.")
      .def(
          "__init__",
          [](PartWriter* self, int k, int n) {
            new (self) PartWriter(parse_part(fmt::format("{}/{}", k, n)), "", "");
          },
          nb::arg("k"), nb::arg("n"))
      .def(
          "bytes",
          [](PartWriter& writer) {
            writer.finish();
            const std::string data = writer.bytes();
            return nb::bytes(data.data(), data.size());
          },
          "The part, once the run has ended; no other run may use this.");
  nb::class_<PartReader, BatchStore>(m, "PartReader", "The batches of all parts of a run.");
  m.def(
      "read_parts",
      [](const std::vector<nb::bytes>& parts) {
        std::vector<std::string> data;
        for (const nb::bytes& part : parts) data.emplace_back(part.c_str(), part.size());
        return PartReader::of_bytes(data);
      },
      nb::arg("parts"),
      "All parts of one run, in any order. Raises limn.InputError that says which is missing, "
      "there "
      "twice, or of another run.");
}

}  // namespace limn::python
