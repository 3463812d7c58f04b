// Scenes of blurred faces: what they may have, and their emitters.
#include "integrators/paths/blurred_scene.h"

#include "integrators/paths/straight_way.h"
#include "limn/core/error.h"

namespace limn {
namespace {

// Whether shading normals are those of the faces.
bool is_flat(const Mesh& mesh) {
  for (size_t f = 0; f < mesh.normal_ids.size(); ++f) {
    if (!has_area(mesh, mesh.faces[f])) continue;
    const auto c = face_corners<double>(mesh, FaceId(static_cast<uint32_t>(f)));
    const Vec3d n = normalize(cross(c[1] - c[0], c[2] - c[0]));
    for (const uint32_t id : mesh.normal_ids[f]) {
      if (!(length(mesh.normals[id] - n) < 1e-5)) return false;  // of normals rounded in files
    }
  }
  return true;
}

// Also beyond the sides of its faces, over which texture coordinates stay linear.
bool is_continuous(const Texture& texture) {
  if (texture.discontinuous_between_texels() || texture.discontinuous_between_faces()) return false;
  Texture::Discontinuities lines;
  const bool all = texture.add_discontinuities({{{-4, -4}, {8, -4}, {-4, 8}}}, 1, lines);
  return all && lines.inside.empty();
}

}  // namespace

void check_blurred(const Scene& scene) {
  for (const Shape& shape : scene.shapes) {
    const auto refuse = [&](const std::string& what) {
      throw InputError(shape.where, "blurred faces do not support " + what);
    };
    if (!is_flat(shape.mesh)) refuse("interpolated normals: set face_normals");
    if (shape.radiance_texture) refuse("textured emitters");
    for (int k = 0; k < shape.bsdf->texture_count(); ++k) {
      if (is_continuous(shape.bsdf->texture(k))) continue;
      refuse("textures with discontinuities: \"" + shape.bsdf->texture_name(k) + "\" has some");
    }
  }
  if (has_straight_ways(scene)) {
    throw InputError({scene.file}, "blurred faces do not support masks and thin panes");
  }
}

BlurredEmitters::BlurredEmitters(const Scene& scene, const Blur& blur)
    : scene_(scene), faces_(scene.shapes.size()) {
  for (size_t s = 0; s < scene_.shapes.size(); ++s) {
    Shape& shape = scene_.shapes[s];
    const Mesh original = std::move(shape.mesh);
    shape.mesh = {};
    if (!shape.is_emitter) continue;
    for (uint32_t f = 0; f < original.faces.size(); ++f) {
      if (!has_area(original, original.faces[f])) continue;
      const auto polygon = enlarged_face(face_corners<double>(original, FaceId(f)), blur.reach());
      for (size_t k = 2; k < polygon.size(); ++k) {
        const auto first = static_cast<uint32_t>(shape.mesh.positions.size());
        for (const Vec3d& x : {polygon[0], polygon[k - 1], polygon[k]}) {
          shape.mesh.positions.push_back(cast<float>(x));
        }
        shape.mesh.faces.push_back({first, first + 1, first + 2});
        faces_[s].push_back(f);
      }
    }
  }
}

BlurredScene::BlurredScene(const Scene& scene, const Blur& blur, int threads,
                           const BlurredScene* unmoved)
    : unmoved_(unmoved ? unmoved->scene() : scene),
      faces_(scene, blur),
      tracer_(make_blur_tracer(faces_, threads)),
      emitters_(scene, blur),
      lights_(emitters_.scene(), unmoved ? &unmoved->lights() : nullptr, DrawFaces::kByArea),
      size_(bounds_of(unmoved_).diagonal()),
      far_(0.5 * size_ + length(value(unmoved_.camera.origin) - bounds_of(unmoved_).center())) {}

}  // namespace limn
