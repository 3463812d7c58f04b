// The figures of limn reject as JSON and as a table.
#include "tools/limn/reject/reject_figures.h"
#include "tools/limn/output_files.h"
#include "tools/limn/table.h"

#include <fmt/format.h>

#include <numeric>

namespace limn {
namespace {

using nlohmann::json;

double share(uint64_t part, uint64_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0;
}

uint64_t of(const VerdictCounts& counts, NodeVerdict verdict) {
  return counts[static_cast<int>(verdict)];
}
uint64_t points_of(const VerdictCounts& counts) {
  return std::accumulate(counts.begin(), counts.end(), uint64_t{0});
}

// Edges where a descent can end over those of E(p) among them.
double reached_per_silhouette(const ReachCounts& counts) {
  return share(counts.silhouettes + counts.false_accepts, counts.silhouettes);
}

json slices_json(const RejectVariant& variant) {
  json slices = json::array();
  for (size_t i = 0; i < variant.slices.size(); ++i) {
    const VerdictCounts& counts = variant.slices[i];
    slices.push_back({{"picture", slice_file(variant.name, i)},
                      {"true_reject", of(counts, NodeVerdict::kTrueReject)},
                      {"true_accept", of(counts, NodeVerdict::kTrueAccept)},
                      {"false_accept", of(counts, NodeVerdict::kFalseAccept)},
                      {"missed", of(counts, NodeVerdict::kMissed)},
                      {"points", points_of(counts)}});
  }
  return slices;
}

json depths_json(const ReachCounts& counts) {
  json depths = json::array();
  for (size_t d = 0; d < counts.by_depth.size(); ++d) {
    const DepthCounts& c = counts.by_depth[d];
    depths.push_back({{"depth", d + 1},
                      {"nodes_tested", c.tested},
                      {"accepted", c.accepted},
                      {"false_accepts", c.false_accepts},
                      {"missed", c.missed}});
  }
  return depths;
}

}  // namespace

uint64_t RejectVariant::missed() const {
  uint64_t sum = counts.missed + reach.missed.size();
  for (const VerdictCounts& slice : slices) sum += of(slice, NodeVerdict::kMissed);
  for (const DepthCounts& depth : counts.by_depth) sum += depth.missed;
  return sum;
}

std::string slice_file(const std::string& variant, size_t slice) {
  return fmt::format("{}_slice_{}.png", file_part(variant), slice);
}
std::string edges_file(const std::string& variant) { return file_part(variant) + "_edges.png"; }

json to_json(const RejectVariant& v) {
  return {{"name", v.name},
          {"description", v.description},
          {"node",
           {{"index", v.match.node},
            {"depth", v.node.depth},
            {"edges", v.node.end - v.node.begin},
            {"overlap", v.match.overlap}}},
          {"slices", slices_json(v)},
          {"edges_picture", edges_file(v.name)},
          {"reachable_edges", v.reach.silhouettes.size() + v.reach.false_accepts.size()},
          {"silhouettes", v.reach.silhouettes.size()},
          {"false_accepts", v.reach.false_accepts.size()},
          {"false_positive_edges", v.reach.false_positives.size()},
          {"missed", v.missed()},
          {"reached_per_silhouette", reached_per_silhouette(v.counts)},
          {"hit_rate", v.hits.mean},
          {"hit_rate_stderr", v.hits.standard_error},
          {"by_depth", depths_json(v.counts)}};
}

void print_table(std::span<const RejectVariant> variants) {
  Table table({{"method", true},
               {"node's edges"},
               {"rejected"},
               {"accepted"},
               {"false positives"},
               {"reached silhouettes"},
               {"others"},
               {"reached per silhouette"},
               {"acceptance rate"}});
  for (const RejectVariant& v : variants) {
    Table::Row row{v.name, std::to_string(v.node.end - v.node.begin)};
    VerdictCounts sum{};  // of both slices
    for (const VerdictCounts& slice : v.slices) {
      for (size_t k = 0; k < sum.size(); ++k) sum[k] += slice[k];
    }
    for (const NodeVerdict verdict :
         {NodeVerdict::kTrueReject, NodeVerdict::kTrueAccept, NodeVerdict::kFalseAccept}) {
      row.push_back(fmt::format("{:.2f} %", 100 * share(of(sum, verdict), points_of(sum))));
    }
    row.push_back(std::to_string(v.reach.silhouettes.size()));
    row.push_back(std::to_string(v.reach.false_accepts.size()));
    row.push_back(fmt::format("{:.2f}", reached_per_silhouette(v.counts)));
    row.push_back(fmt::format("{:.4f} +- {:.4f}", v.hits.mean, v.hits.standard_error));
    table.add(std::move(row));
  }
  fmt::print("\n{}", table.text());
}

}  // namespace limn
