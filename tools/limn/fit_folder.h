#pragma once
// The folder of a fit: its options, state, history, snapshots.
//
//   fit.json        arguments, history, snapshots, status: for reports, and for --resume
//   state.cbor      all numbers that a later step depends on
//   history.csv     a line per step
//   step_N_SHAPE.ply, step_N_EMITTER.data.exr, step_N_view_K.png, view_K_target.png
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "limn/core/mesh.h"
#include "limn/integrators/fit.h"
#include "tools/limn/output_files.h"

namespace limn {

// A view as the command line says it: "FILE" or "FILE;NAME=VALUE;...".
struct ViewArguments {
  std::string scene;
  std::map<std::string, std::string> defines;
  std::string sensor;        // its number in the scene
  std::string target, mask;  // "": no mask
  bool alpha = false;        // the target is of the scene's coverage
  // Of the scene, the images and the fields of vertices as the fit found them.
  std::map<std::string, std::string> fingerprints;
};

// What fixes the bits of a fit, and what is kept of it. Files have absolute names.
struct FitArguments {
  std::vector<ViewArguments> views;
  FitOptions options;               // but for the bounds:
  std::vector<std::string> bounds;  // as texts
  std::string shading = "continuous";
  int spp = 0;
  uint64_t seed = 0;
  int64_t steps = 0;
  int snapshots = 0;  // steps between two
  std::string truth;  // a mesh; "" if none

  FitOptions all_options() const;
};

class FitFolder {
 public:
  FitFolder(const std::string& folder, const FitArguments& arguments);
  // What an earlier run has left. InputError if there is none, or it is not that of a fit.
  static FitFolder read(const std::string& folder);

  const FitArguments& arguments() const { return arguments_; }
  const std::string& name() const { return folder_; }
  void set_steps(int64_t steps) { arguments_.steps = steps; }
  void set_samples(int spp, uint64_t seed) {
    arguments_.spp = spp;
    arguments_.seed = seed;
  }
  // Makes the folder, and notes what distinguishes the scenes; InputError if it holds a fit
  // already, or cannot be written, or a file that the fit reads lies in its place.
  void prepare(const std::vector<FitView>& views);
  // InputError where what the views were read from is not as it was when the fit began.
  void check_inputs(const std::vector<FitView>& views) const;
  // Brings `fit` to the state in the folder, and forgets what came after. InputError that names the
  // file which is damaged or of another fit.
  void restore(Fit& fit);

  // Whether its last step found nothing lower, and no remeshing is left before the end.
  bool at_rest(const Fit& fit) const;
  void add(const FitRecord& record, const Fit& fit);
  // Meshes and their figures, pictures of all views by `spp` samples per pixel (none: 0, and then a
  // snapshot of this step stays as it is); says so unless quiet.
  void add_snapshot(const Fit& fit, const RunSettings& settings, int spp, bool quiet);
  // The state last: a crash before leaves the older one, and --resume forgets what came after it.
  void write(const Fit& fit, const std::string& status, const std::vector<std::string>& warnings);

 private:
  std::string file(const std::string& name) const;
  nlohmann::json mesh_figures(const Shape& shape, const std::string& name, int threads) const;

  // Headings where they are not those of the last snapshot.
  void print_snapshot(const Fit& fit, const nlohmann::json& meshes);

  std::string folder_;
  std::string headings_;  // that were printed last
  bool told_negative_ = false;
  FitArguments arguments_;
  nlohmann::json history_ = nlohmann::json::array(), snapshots_ = nlohmann::json::array();
};

}  // namespace limn
