#pragma once
// The files of `limn backward`: gradients of scalars in one JSON, of vertices as meshes, arrays and
// pictures.
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "limn/core/scene.h"
#include "limn/integrators/backward.h"
#include "tools/limn/output_files.h"

namespace limn {

struct BackwardFiles {
  // Of one array, named after it: FOLDER/object.vertex_positions.ply, ... Of texels there are exr,
  // stderr_exr, npy and png; of vertices the others.
  struct Array {
    std::string parameter;
    ShapeId shape;  // none of texels
    std::string ply, npy, txt, png, exr, stderr_exr;
  };
  std::string json;
  std::string adjoint, adjoint_picture;  // of a loss; "" where it is given
  std::vector<Array> arrays;

  std::vector<PlannedFile> planned(const std::string& also) const;
};

// parameters: as --wrt says; none: all of the scene. InputError for unknown ones.
BackwardFiles plan_files(const Scene& scene, const std::vector<std::string>& parameters,
                         const std::string& folder);

// Writes all arrays and says so; returns the figures of all parameters.
nlohmann::json write_parameters(const Scene& scene, const BackwardFiles& files,
                                const BackwardResult& result, bool quiet);

}  // namespace limn
