// The table of terms, and what they are made from.
#include "integrators/terms/term.h"

#include <algorithm>

#include "integrators/edges/scene_edges.h"
#include "integrators/paths/chain_light.h"
#include "integrators/terms/term_table.h"

namespace limn {

static_assert(std::size(kTermTypes) <= kMostTerms);

std::span<const TermType> term_types() { return kTermTypes; }

const TermType& film_term() { return *std::ranges::find_if(kTermTypes, &TermType::on_film_alone); }

bool has_term(const EdgeSamplerType& sampler, const TermType& type, bool closed, bool moved_film) {
  if (type.regions && !sampler.regions) return false;
  if (type.moved_film && !moved_film) return false;
  return !closed || !type.moved_with_directions || type.traces_paths;
}

std::vector<const TermType*> terms_of(const Scene& scene, const EdgeSamplerType& sampler,
                                      bool closed, bool moved_film) {
  std::vector<const TermType*> types;
  bool (*tested)(const Scene&) = nullptr;  // looks at the whole environment: once for rows alike
  bool applies = false;
  for (const TermType& type : term_types()) {
    if (!has_term(sampler, type, closed, moved_film)) continue;
    if (type.applies != tested) {
      tested = type.applies;
      applies = tested(scene);
    }
    if (applies) types.push_back(&type);
  }
  return types;
}

Moved moved_in(const Scene& scene, std::span<const Parameter> parameters) {
  Moved moved = moved_by(parameters);
  moved.rays = !moved.vertices && find_smooth(scene) && moves_what_is_seen(scene, parameters);
  return moved;
}

std::vector<bool> changed_terms(std::span<const TermType* const> types,
                                const std::vector<bool>& computed, const Moved& moved) {
  std::vector<bool> changed(types.size());
  for (size_t t = 0; t < types.size(); ++t) changed[t] = computed[t] && types[t]->changes(moved);
  return changed;
}

const EdgeSamplerInput& TermInput::edges() {
  if (edges_) return *edges_;
  const Stopwatch watch;
  edges_ = std::make_unique<EdgeSamplerInput>(kept ? kept->make(context.scene, threads)
                                                   : make_scene_edges(context.scene, threads));
  edges_->lane_scale = lane_scale;
  if (sampler.regions) {
    regions_ = std::make_unique<LightRegions>(context.scene);
    if (regions_->empty()) regions_.reset();
  }
  edges_seconds_ = watch.seconds();
  return *edges_;
}

const EdgeSamplerInput& TermInput::chosen_edges() {
  if (!warps) return edges();
  if (!unfollowed_) {
    unfollowed_ = std::make_unique<EdgeSamplerInput>(edges());
    for (EdgeMesh& mesh : unfollowed_->objects) leave_out_followed(mesh);
  }
  return *unfollowed_;
}

const LightRegions* TermInput::regions() {
  edges();
  return regions_.get();
}

const EmitterEdges* TermInput::emitter_edges() {
  if (!emitter_edges_ && regions()) {
    const Stopwatch watch;
    emitter_edges_ = std::make_unique<EmitterEdges>(context.scene, edges(), *regions_, lanes);
    edges_seconds_ += watch.seconds();
  }
  return emitter_edges_.get();
}

const EdgeSampler& TermInput::edge_sampler() {
  if (edge_sampler_) return *edge_sampler_;
  chosen_edges();
  const Stopwatch watch;
  EdgeSamplerInput& input = warps ? *unfollowed_ : *edges_;
  if (regions_) {
    regions_->add_rest(input);
  } else {
    kept ? kept->add_light(context.scene, input) : add_light(context.scene, input);
  }
  edge_sampler_ = sampler.make(input, threads, kept ? kept->shared() : nullptr);
  edge_sampler_seconds_ = watch.seconds();
  return *edge_sampler_;
}

}  // namespace limn
