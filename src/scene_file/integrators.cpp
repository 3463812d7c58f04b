// The table of integrator types that are read as paths.
#include "src/scene_file/scene_sensor.h"

#include <algorithm>

#include "limn/core/names.h"

namespace limn {

namespace {

const Makers kNoMakers;

struct IntegratorType {
  const char* name;
  int max_depth = -1;                       // if absent
  bool is_depth_fixed = false;              // max_depth cannot be given
  bool is_volumetric = false;               // see check_null
  bool is_wrapper = false;                  // its first nested integrator decides
  std::vector<std::string> ignored = {};    // parameters that change no expectation
  std::vector<std::string> unwritten = {};  // parameters that ask for images that limn lacks
};

const std::vector<IntegratorType>& types() {
  const std::vector<std::string> projective = {"guiding", "guiding_proj", "guiding_rounds",
                                               "sppc",    "sppi",         "sppp"};
  const std::vector<std::string> reparam = {"reparam_antithetic", "reparam_exp",  "reparam_kappa",
                                            "reparam_max_depth",  "reparam_rays", "reparam_unroll"};
  static const std::vector<IntegratorType> all = {
      {"aov", -1, false, false, true, {}, {"aovs"}},
      {"direct", 2, true, false, false, {"bsdf_samples", "emitter_samples", "shading_samples"}},
      {"direct_projective", 2, true, false, false, projective},
      {"direct_reparam", 2, true, false, false, reparam},
      {"moment", -1, false, false, true},
      {"path", -1},
      {"prb", 6},
      {"prb_basic", 6},
      {"prb_projective", 6, false, false, false, projective},
      {"prb_reparam", 6, false, false, false, reparam},
      {"prbvolpath", 6, false, true},
      {"ptracer", -1, false, false, false, {"samples_per_pass"}},
      {"volpath", -1, false, true},
      {"volpathmis", -1, false, true, false, {"use_spectral_mis"}},
  };
  return all;
}

int depth(Properties& p, const std::string& name, int absent, int least, const char* range) {
  const int64_t read = p.integer(name, absent);
  if (read < least) p.fail(name, range);
  if (read > INT32_MAX) p.fail(name, "must be at most 2147483647");
  return static_cast<int>(read);
}

const ObjectDescription* find_type(const ObjectDescription& object, const std::string& tag,
                                   const std::vector<std::string>& types) {
  if (object.tag == tag && std::ranges::find(types, object.type) != types.end()) return &object;
  for (const ChildDescription& child : object.children) {
    if (const ObjectDescription* found = find_type(*child.object, tag, types)) return found;
  }
  return nullptr;
}
const ObjectDescription* find_type(const SceneDescription& description, const std::string& tag,
                                   const std::vector<std::string>& types) {
  for (const auto& root : description.objects) {
    if (const ObjectDescription* found = find_type(*root, tag, types)) return found;
  }
  return nullptr;
}

// Volumetric integrators go straight through masks also towards lights, and count no bounce there.
// Paths go through by chance and then count a light that they meet fully, so the expectation is the
// same: without a limit of bounces, and but for lights that no path meets and hidden emitters,
// which are hidden behind what counts as no bounce, too.
void check_null(const SceneDescription& description, const std::string& integrator,
                const Scene& scene) {
  const auto* null = find_type(description, "bsdf", {"mask", "null", "thindielectric"});
  if (!null) return;
  const auto fail = [&](const std::string& what) {
    throw InputError(null->where, "bsdf \"" + null->type + "\": " + integrator + what);
  };
  if (scene.max_depth >= 0) {
    fail(
        " counts no bounce there, and path does: set max_depth to -1, or change the integrator to "
        "path");
  }
  if (scene.hide_emitters) {
    fail(
        " hides emitters behind it, and path shows them: set hide_emitters to false, or change the "
        "integrator to path");
  }
  const auto* light =
      find_type(description, "emitter", {"directional", "point", "projector", "spot"});
  if (light) {
    fail(" lets light of a " + light->type +
         " pass it, and path does not: change the integrator to path");
  }
}

}  // namespace

void read_integrator(const ObjectDescription& object, const SceneDescription& description,
                     Scene& scene, std::vector<std::string>& warnings) {
  const auto type = std::find_if(types().begin(), types().end(),
                                 [&](const IntegratorType& t) { return object.type == t.name; });
  if (type == types().end()) {
    throw InputError(object.where, unknown_type("integrator", object.type, names_of(types())));
  }
  DescribedProperties p(object, description, kNoMakers);
  for (const std::string& name : type->unwritten) {
    if (!p.has(name)) continue;
    warnings.push_back(format_warning(p.where(name), name + " are not written"));
  }
  if (type->is_wrapper) {
    const ObjectDescription* nested = p.nested("integrator");
    p.check_all_used();
    if (!nested) {
      p.fail(std::string("takes one integrator") +
             (object.type == "aov" ? "; render --what writes depth, normals, ..." : ""));
    }
    read_integrator(*nested, description, scene, warnings);
    return;
  }
  scene.max_depth = type->max_depth;
  if (!type->is_depth_fixed) {
    scene.max_depth = depth(p, "max_depth", type->max_depth, -1, kDepthRange);
    if (scene.max_depth == 0) p.fail("max_depth", kDepthRange);
  }
  if (!type->is_depth_fixed) scene.rr_depth = depth(p, "rr_depth", 5, 1, "must be 1 or more");
  scene.hide_emitters = p.boolean("hide_emitters", false);
  for (const std::string& name : type->ignored) p.has(name);
  p.check_all_used();
  if (!type->is_volumetric) return;
  if (!description.media.empty()) {
    throw InputError(description.media.front(),
                     object.type +
                         " sees media, and limn has no volumes: change the integrator to "
                         "path, which ignores them");
  }
  check_null(description, object.type, scene);
}

}  // namespace limn
