// The figures of limn reject as JSON, CSV and tables.
#include "tools/limn/reject/reject_figures.h"
#include "tools/limn/output_files.h"

#include <fmt/format.h>

#include <algorithm>
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

void print_summary(std::span<const RejectVariant> variants) {
  constexpr const char* kHead =
      "\n{:<16} {:>6} {:>23} {:>23} {:>25} {:>8}\n"
      "{:<16} {:>6} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>8} {:>7} {:>8} {:>8}  {}\n";
  fmt::print(kHead, "", "node's", "slice 0 (%)", "slice 1 (%)", "one point: edges", "reached/",
             "method", "edges", "reject", "accept", "false", "reject", "accept", "false", "silhou.",
             "false", "positive", "silhou.", "acceptance rate");
  for (const RejectVariant& v : variants) {
    fmt::print("{:<16} {:>6}", v.name, v.node.end - v.node.begin);
    for (const VerdictCounts& counts : v.slices)
      for (const NodeVerdict verdict :
           {NodeVerdict::kTrueReject, NodeVerdict::kTrueAccept, NodeVerdict::kFalseAccept})
        fmt::print(" {:7.2f}", 100 * share(of(counts, verdict), points_of(counts)));
    fmt::print(" {:>8} {:>7} {:>8} {:8.2f}  {:.4f} +- {:.4f}\n", v.reach.silhouettes.size(),
               v.reach.false_accepts.size(), v.reach.false_positives.size(),
               reached_per_silhouette(v.counts), v.hits.mean, v.hits.standard_error);
  }
}

void print_depths(std::span<const RejectVariant> variants) {
  size_t depths = 0;
  fmt::print("\nfalse accepts per point (share of the nodes accepted)\n{:>5}", "depth");
  for (const RejectVariant& v : variants) {
    fmt::print(" {:>18}", v.name);
    depths = std::max(depths, v.counts.by_depth.size());
  }
  for (size_t d = 0; d < depths; ++d) {
    fmt::print("\n{:>5}", d + 1);
    for (const RejectVariant& v : variants) {
      const bool any = d < v.counts.by_depth.size();
      const DepthCounts counts = any ? v.counts.by_depth[d] : DepthCounts{};
      fmt::print(" {:>18}", any ? fmt::format("{:.1f} ({:4.1f} %)",
                                              share(counts.false_accepts, v.counts.points),
                                              100 * share(counts.false_accepts, counts.accepted))
                                : "");
    }
  }
  fmt::print("\n");
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

std::string summary_csv(std::span<const RejectVariant> variants) {
  std::string text =
      "variant,node_edges,node_overlap,slice,true_reject,true_accept,false_accept,missed,hit_rate,"
      "hit_rate_stderr,reached_per_silhouette,silhouettes,false_accepts,false_positive_edges\n";
  for (const RejectVariant& v : variants) {
    for (size_t i = 0; i < v.slices.size(); ++i) {
      const VerdictCounts& c = v.slices[i];
      text += fmt::format("{},{},{:.6g},{},{},{:.6g},{:.3g},{:.6g},{},{},{}\n", v.name,
                          v.node.end - v.node.begin, v.match.overlap, i, fmt::join(c, ","),
                          v.hits.mean, v.hits.standard_error, reached_per_silhouette(v.counts),
                          v.reach.silhouettes.size(), v.reach.false_accepts.size(),
                          v.reach.false_positives.size());
    }
  }
  return text;
}

std::string depth_csv(std::span<const RejectVariant> variants) {
  std::string text = "variant,depth,nodes_tested,accepted,false_accepts,missed\n";
  for (const RejectVariant& v : variants) {
    for (size_t d = 0; d < v.counts.by_depth.size(); ++d) {
      const DepthCounts& c = v.counts.by_depth[d];
      text += fmt::format("{},{},{},{},{},{}\n", v.name, d + 1, c.tested, c.accepted,
                          c.false_accepts, c.missed);
    }
  }
  return text;
}

void print_tables(std::span<const RejectVariant> variants) {
  print_summary(variants);
  print_depths(variants);
}

}  // namespace limn
