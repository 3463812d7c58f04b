#pragma once
// The figures of `limn reject`, for people and machines.
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "limn/edgetree/rejection_places.h"

namespace limn {

// What was measured of one sampler.
struct RejectVariant {
  std::string name, description;
  Match match;  // its node
  RejectionNode node{};
  std::vector<VerdictCounts> slices;
  Reach reach;         // from one point
  ReachCounts counts;  // from many points
  AcceptanceRate hits;

  // How often a test rejected what holds an edge of E(p), and edges of E(p) that were not reached.
  uint64_t missed() const;
};

std::string slice_file(const std::string& variant, size_t slice);
std::string edges_file(const std::string& variant);

nlohmann::json to_json(const RejectVariant& variant);
// Prints a row per variant to standard output.
void print_table(std::span<const RejectVariant> variants);

}  // namespace limn
