// Rays around the corners of pixels, and the adjoint of the mean motion of what they meet.
#include "integrators/backward/film_field.h"

#include <algorithm>
#include <cmath>

#include "integrators/terms/boundary_sample.h"
#include "limn/core/parallel.h"
#include "limn/core/reverse.h"
#include "limn/core/surface_point.h"

namespace limn {
namespace {

// So many rays a pixel along each axis. Not tuned.
constexpr int kAcross = 2;
constexpr int kRays = kAcross * kAcross;

// What a ray meets; no face: nothing.
struct Met {
  FaceRef face;
  Vec3d x, normal;
};

// Whether radiance is likely to be discontinuous between two points: they lie on different shapes,
// or on surfaces more than about 18 degrees apart (not tuned).
bool are_apart(const Met& a, const Met& b) {
  constexpr double kSine = 0.3, kCosine = 0.95;
  if (a.face == b.face) return false;
  if (a.face.shape != b.face.shape || dot(a.normal, b.normal) < kCosine) return true;
  const Vec3d way = b.x - a.x;
  const double most = kSine * length(way);
  return std::fabs(dot(a.normal, way)) > most || std::fabs(dot(b.normal, way)) > most;
}

}  // namespace

FilmField::FilmField(const Scene& scene, const SceneSlots& slots)
    : scene_(scene),
      scene_slots_(slots),
      width_(scene.film.crop_width),
      height_(scene.film.crop_height),
      slots_(index(0, height_ + 1)),
      weights_(slots_.size()) {}

std::unique_ptr<FilmField> FilmField::make(const PathContext& context, double least_detail,
                                           ParameterSlots& slots, int threads) {
  std::unique_ptr<FilmField> field(new FilmField(context.scene, slots.slots()));
  const size_t pixels = static_cast<size_t>(field->width_) * field->height_;
  // Scenes without detail are recognised by every seventh pixel. Not tuned.
  constexpr size_t kStep = 7;
  constexpr double kLeastShare = 1.0 / 8;
  std::vector<Sight> seen;
  double count = 0, detailed = 0;
  for (size_t pixel = 0; pixel < pixels; pixel += kStep) {
    ++count;
    detailed += field->look(context, pixel, seen) >= least_detail;
  }
  if (detailed < kLeastShare * count) return nullptr;
  std::vector<double> detail(pixels);
  std::vector<std::vector<Sight>> rows(field->height_);
  parallel_for(rows.size(), threads, [&](size_t row) {
    for (size_t i = row * field->width_; i < (row + 1) * field->width_; ++i) {
      detail[i] = field->look(context, i, rows[row]);
    }
  });
  for (const auto& row : rows) {
    field->sights_.insert(field->sights_.end(), row.begin(), row.end());
  }
  field->take_slots(detail, least_detail, slots);
  return field->sights_.empty() ? nullptr : std::move(field);
}

bool FilmField::follows(FaceRef face) const {
  return scene_slots_.camera != 0 || scene_slots_.mesh(face.shape).positions != 0;
}

// Stratified; returns the share of pairs that meet points apart.
double FilmField::look(const PathContext& context, size_t pixel, std::vector<Sight>& sights) const {
  const Film& film = scene_.film;
  const CameraView<double> camera(scene_.camera);
  const auto column = static_cast<int>(pixel % width_), row = static_cast<int>(pixel / width_);
  constexpr uint64_t kStream = 0xf1e1d;  // any number: V must not depend on a run's samples
  Rng rng = Rng(mix_bits(kStream), pixel, 0).at(Purpose::kFilm, 0);
  std::array<Met, kRays> met;
  int pairs = 0;
  for (int i = 0; i < kRays; ++i) {
    const double u = rng.uniform(), v = rng.uniform();
    Sight sight{static_cast<float>(film.crop_x + column + (i % kAcross + u) / kAcross),
                static_cast<float>(film.crop_y + row + (i / kAcross + v) / kAcross),
                {}};
    const auto ray = camera.ray<double>(sight.x, sight.y);
    Hit hit;
    if (context.tracer.closest(camera_ray(scene_, ray), hit)) {
      const auto surface = surface_on_ray<double>(scene_, hit.face, ray.origin, ray.direction);
      met[i] = {hit.face, surface.p, surface.n_s};
      sight.face = hit.face;
      if (follows(hit.face)) sights.push_back(sight);
    }
    for (int j = 0; j < i; ++j) pairs += are_apart(met[i], met[j]);
  }
  return pairs / (0.5 * kRays * (kRays - 1));
}

void FilmField::take_slots(const std::vector<double>& detail, double least, ParameterSlots& slots) {
  for (const Sight& sight : sights_) {
    for (const Corner& corner : at(sight.at())) weights_[corner.corner] += corner.phi;
  }
  for (int row = 0; row <= height_; ++row) {
    for (int column = 0; column <= width_; ++column) {
      double sum = 0;
      int count = 0;
      for (int y = std::max(0, row - 1); y <= std::min(row, height_ - 1); ++y) {
        for (int x = std::max(0, column - 1); x <= std::min(column, width_ - 1); ++x) {
          sum += detail[static_cast<size_t>(y) * width_ + x];
          ++count;
        }
      }
      const size_t corner = index(column, row);
      if (weights_[corner] > 0 && sum >= least * count) slots_[corner] = slots.take(2, 0);
    }
  }
  std::erase_if(sights_, [&](const Sight& sight) { return !moves(sight.at()); });
  sights_.shrink_to_fit();
}

std::array<FilmField::Corner, 4> FilmField::at(const FilmPosition& position) const {
  const double x = position.x - scene_.film.crop_x, y = position.y - scene_.film.crop_y;
  const int column = std::clamp(static_cast<int>(x), 0, width_ - 1);
  const int row = std::clamp(static_cast<int>(y), 0, height_ - 1);
  const double u = std::clamp(x - column, 0.0, 1.0), v = std::clamp(y - row, 0.0, 1.0);
  const double in_x = x < 0 || x > width_ ? 0 : 1, in_y = y < 0 || y > height_ ? 0 : 1;
  std::array<Corner, 4> corners;
  for (int k = 0; k < 4; ++k) {
    const bool right = k % 2 == 1, low = k / 2 == 1;
    const double a = right ? u : 1 - u, b = low ? v : 1 - v;
    const size_t corner = index(column + right, row + low);
    corners[k] = {corner, slots_[corner], a * b, in_x * (right ? b : -b), in_y * (low ? a : -a)};
  }
  return corners;
}

bool FilmField::moves(const FilmPosition& position) const {
  return std::ranges::any_of(at(position), [](const Corner& corner) { return corner.slot != 0; });
}

Camera::FilmPoint<Var> FilmField::moving(const FilmPosition& position) const {
  const auto corners = at(position);
  Tape& tape = *Tape::current();
  const auto along = [&](double value, uint32_t axis) -> Var {
    std::array<uint32_t, 4> nodes{};
    bool moves = false;
    for (int k = 0; k < 4; ++k) {
      if (corners[k].slot != 0) nodes[k] = tape.leaf(corners[k].slot + axis);
      moves = moves || nodes[k] != 0;
    }
    if (!moves) return value;
    for (int k = 0; k < 4; ++k) tape.entry(nodes[k], corners[k].phi);
    return {value, tape.end()};
  };
  const Var x = along(position.x, 0);
  return {x, along(position.y, 1)};
}

void FilmField::gather(std::vector<double>& sums) const {
  for (const Sight& sight : sights_) {
    double along_x = 0, along_y = 0;
    for (const Corner& corner : at(sight.at())) {
      if (corner.slot == 0) continue;
      const double share = corner.phi / weights_[corner.corner];
      along_x += share * sums[corner.slot];
      along_y += share * sums[corner.slot + 1];
    }
    if (along_x != 0 || along_y != 0) gather_sight(sight, along_x, along_y, sums);
  }
}

// As the point of the face moves, and the camera against it.
void FilmField::gather_sight(const Sight& sight, double along_x, double along_y,
                             std::vector<double>& sums) const {
  const auto ray = CameraView<double>(scene_.camera).ray<double>(sight.x, sight.y);
  const Vec3d p = surface_on_ray<double>(scene_, sight.face, ray.origin, ray.direction).p;
  if (const uint32_t first = scene_slots_.mesh(sight.face.shape).positions; first != 0) {
    const Vec3<Dual> x{{p.x, {1, 0, 0, 0}}, {p.y, {0, 1, 0, 0}}, {p.z, {0, 0, 1, 0}}};
    const auto at = CameraView<Dual>(scene_.camera).project(x);
    const Mesh& mesh = scene_.shape(sight.face.shape).mesh;
    const auto b = barycentric(face_corners<double>(mesh, sight.face.face), p);
    for (int k = 0; k < 3; ++k) {
      const uint32_t root = mesh.weld[mesh.face(sight.face.face)[k]];
      for (int c = 0; c < 3; ++c) {
        sums[first + 3 * root + c] += b[k] * (along_x * at.x.d[c] + along_y * at.y.d[c]);
      }
    }
  }
  if (scene_slots_.camera == 0) return;
  Tape tape(&scene_slots_);
  const TapeScope scope(tape);
  const auto at = camera_leaves(scene_.camera).project(Vec3<Var>{p.x, p.y, p.z});
  tape.start();
  tape.adjoint(at.x.node) += along_x;
  tape.adjoint(at.y.node) += along_y;
  tape.sweep();
  for (const Contribution& c : tape.contributions()) sums[c.slot] += c.value;
}

CameraRay<Var> moving_ray(const Scene& scene, const FilmField* field, const FilmPlace& place) {
  const CameraView<Var> view = camera_leaves(scene.camera);
  if (!field) return ray_at(view, place);
  const auto at = field->moving(place);
  return view.ray(at.x, at.y);
}

}  // namespace limn
