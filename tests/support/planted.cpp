// Defects made from right gradients: scaled, or of another scene.
#include "support/planted.h"

#include <fmt/format.h>

#include <memory>

#include "support/meshes.h"

namespace limn {
namespace {

Moments sum_of(const Moments& a, const Moments& b, double factor) {
  Moments sum(a.size(), true);
  for (size_t i = 0; i < a.kept().size(); ++i) {
    std::vector<double> sums = a.kept()[i].sums;
    for (size_t k = 0; k < sums.size(); ++k) sums[k] += factor * b.kept()[i].sums[k];
    sum.add_batch(sums, a.kept()[i].samples);
  }
  return sum;
}

Moments total_of(const Moments& blocks) {
  Moments total(1);
  for (const auto& batch : blocks.kept()) {
    double sum = 0;
    for (const double v : batch.sums) sum += v;
    total.add_batch({sum}, batch.samples);
  }
  return total;
}

// Adds a multiple of a term of `from` to that of `to`.
void add_term(GradientResult& to, const GradientResult& from, const std::string& name,
              double factor) {
  const size_t t = to.term(name);
  ParameterGradient& g = to.parameters[0];
  const Moments& add = from.parameters[0].term_blocks[from.term(name)];
  g.total_blocks = sum_of(g.total_blocks, add, factor);
  g.term_blocks[t] = sum_of(g.term_blocks[t], add, factor);
  g.image_sum = total_of(g.total_blocks);
}

SceneParts base_parts() {
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0, 3, 4};
  return parts;
}

std::string field(const TempFiles& files, const std::string& name, size_t still, size_t moving) {
  std::string text;
  for (size_t i = 0; i < still; ++i) text += "0 0 0\n";
  for (size_t i = 0; i < moving; ++i) text += "0.3 1 0.2\n";
  return files.write(name, text);
}

}  // namespace

GradientRun scaled_term(const std::string& term, double factor) {
  return [=](const Scene& scene, const GradientOptions& options, const RunSettings& settings) {
    GradientResult result = gradient(scene, options, settings);
    const GradientResult right = result;
    add_term(result, right, term, factor - 1);
    return result;
  };
}

namespace {

// more: further shapes.
Planted planted_ball(const TempFiles& files, const Mesh& ball, const std::string& more,
                     const std::string& method, const std::string& term, double factor, int spp) {
  SceneParts parts = base_parts();
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.8, 0.8")) +
               obj_shape("ball", write_mesh(files, "ball.obj", ball), false, 0.8, {0, 1, 0},
                         diffuse("clay", "0.3, 0.2, 0.2")) +
               square("lamp", 1, 90, {0, 2.5, 1}, area_light("glow", "5, 5, 5")) + more;
  Planted planted{fmt::format("{} of {} times {}", term, method, factor),
                  make_scene(files, parts),
                  {},
                  spp,
                  scaled_term(term, factor),
                  std::fabs(1 - factor),
                  {term}};
  planted.options.parameter = "ball.translate.y";
  planted.options.method = method;
  return planted;
}

}  // namespace

Planted planted_term(const TempFiles& files, const std::string& method, const std::string& term,
                     double factor, int spp) {
  return planted_ball(files, icosphere_mesh(1), "", method, term, factor, spp);
}

Planted planted_beside_kink(const TempFiles& files, const std::string& method,
                            const std::string& term, double factor, int spp) {
  const auto tile = [](float x) {
    const float y = -0.8f, z = -0.5f, size = 0.25f;
    return make_mesh({{x, y, z}, {x, y, z + size}, {x + size, y, z + size}, {x + size, y, z}},
                     {{0, 1, 2}, {0, 2, 3}});
  };
  const std::string other = obj_shape("tile", write_mesh(files, "tile.obj", tile(-2.25f)), false,
                                      0.8, {0, 1, 0}, diffuse("slate", "0.5, 0.5, 0.6"));
  return planted_ball(files, joined(icosphere_mesh(1), tile(-2)), other, method, term, factor, spp);
}

Planted planted_in_closed_form(const std::string& file, const std::string& parameter,
                               const std::string& method, const std::string& term, double factor,
                               int spp) {
  Planted planted{fmt::format("{} of {}, {}, {} times {}", term, file, parameter, method, factor),
                  read_scene(LIMN_SOURCE_DIR "/scenes/closed_form/" + file + ".xml", {}, nullptr),
                  {},
                  spp,
                  scaled_term(term, factor),
                  std::fabs(1 - factor),
                  {term}};
  planted.options.parameter = parameter;
  planted.options.method = method;
  return planted;
}

Planted planted_border(const TempFiles& files, int spp) {
  SceneParts parts = base_parts();
  const Mesh cube = cube_mesh();
  const Mesh leaf = make_mesh({{1.5f, -1, 0.3f}, {3, -1, 0}, {3, 0.5f, -0.3f}, {1.5f, 0.5f, 0}},
                              {{0, 1, 2}, {0, 2, 3}});
  const std::string both =
      R"(<bsdf type="twosided">)" + diffuse("green", "0.3, 0.6, 0.2") + "</bsdf>";
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.8, 0.8")) +
               obj_shape("parts", write_mesh(files, "parts.obj", joined(cube, leaf)), true, 0.4,
                         {-0.4, 0.8, 0}, both) +
               square("lamp", 0.7, 90, {0, 2.5, 1}, area_light("glow", "9, 9, 9"));
  const size_t of_cube = cube.positions.size(), of_leaf = leaf.positions.size();
  const std::string all = field(files, "all.txt", 0, of_cube + of_leaf);
  const std::string borders = field(files, "borders.txt", of_cube, of_leaf);
  const std::vector<std::string> edges = {"camera", "boundary", "direct"};
  Planted planted{"borders left out", make_scene(files, parts), {}, spp, nullptr, 0, edges};
  planted.run = [=](const Scene& scene, GradientOptions options, RunSettings settings) {
    GradientResult result = gradient(scene, options, settings);
    options.parameters = {"parts.vertex_positions:" + borders};
    settings.seed += 77;
    const GradientResult missing = gradient(scene, options, settings);
    for (const std::string& term : edges) add_term(result, missing, term, -1);
    return result;
  };
  planted.options.parameter = "parts.vertex_positions:" + all;
  // What terms hold by themselves must not depend on the run.
  planted.options.method = "silhouettes";
  return planted;
}

Planted planted_normals(const TempFiles& files, int spp) {
  SceneParts parts = base_parts();
  // The ball fills the picture: windows tell its inside from its outline.
  parts.origin = {0, 1.2, 3.6};
  parts.target = {0, 1, 0};
  parts.width = parts.height = 32;
  const Mesh ball = with_smooth_normals(icosphere_mesh(1));
  const std::string plain = write_mesh(files, "plain.obj", ball);
  // The same normals, but as numbers that nothing moves.
  std::string text, velocities;
  for (const Vec3f& x : ball.positions) text += fmt::format("v {} {} {}\n", x.x, x.y, x.z);
  for (const auto& n : ball.normals) text += fmt::format("vn {} {} {}\n", n.x, n.y, n.z);
  for (const FaceIndices& f : ball.faces) {
    text += fmt::format("f {0}//{0} {1}//{1} {2}//{2}\n", f[0] + 1, f[1] + 1, f[2] + 1);
  }
  for (const Vec3f& x : ball.positions) velocities += fmt::format("{} {} 0\n", x.y, 0.3 * x.x);
  const std::string still = files.write("still.obj", text);
  const auto scene_of = [&](const std::string& mesh) {
    SceneParts with = parts;
    with.body = square("floor", 3, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.8, 0.8")) +
                obj_shape("ball", mesh, false, 0.9, {0, 1, 0}, diffuse("clay", "0.8, 0.7, 0.6")) +
                square("lamp", 0.5, 90, {0.6, 2.6, 1.2}, area_light("glow", "9, 9, 9"));
    return make_scene(files, with);
  };
  const auto wrong = std::make_shared<Scene>(scene_of(still));
  Planted planted{"normals held", scene_of(plain), {}, spp, nullptr, 0, {"interior"}};
  planted.run = [wrong](const Scene&, const GradientOptions& options, const RunSettings& settings) {
    return gradient(*wrong, options, settings);
  };
  planted.options.parameter = "ball.vertex_positions:" + files.write("shear.txt", velocities);
  planted.options.method = "silhouettes";
  return planted;
}

}  // namespace limn
