#pragma once
// How positions on the film move in reverse mode: with what they see. The motion is V(x) = sum_i
// phi_i(x) m_i, bilinear between the corners of pixels, and m_i is the mean motion on the film of
// points that rays around corner i meet. The substitution x -> x + theta V changes no integral
// (terms/filter.cpp), so the derivatives by m_i have mean zero: they are slots of their own, and
// what they sum up to goes on to the vertices and the camera that m_i is linear in.
#include <array>
#include <memory>
#include <vector>

#include "integrators/backward/parameter_slots.h"
#include "integrators/paths/camera_path.h"
#include "integrators/paths/path_context.h"
#include "limn/core/var.h"

namespace limn {

class FilmField {
 public:
  // least_detail: as of BackwardOptions. Null where positions are held everywhere. Takes slots, of
  // which magnitudes do not count; all arguments must outlive it.
  static std::unique_ptr<FilmField> make(const PathContext& context, double least_detail,
                                         ParameterSlots& slots, int threads);

  // Of a corner: the slot of m_i along x, before that along y; 0 where positions are held.
  // column, row: from 0 to the width and height of the crop.
  uint32_t slot(int column, int row) const { return slots_[index(column, row)]; }

  // What V is made of at a position: of each corner around it its slot, phi_i and its gradient. It
  // goes on beyond the crop as it is on the rim.
  struct Corner {
    size_t corner;
    uint32_t slot;
    double phi, dx, dy;
  };
  std::array<Corner, 4> at(const FilmPosition& position) const;
  bool moves(const FilmPosition& position) const;
  // The position, as it moves, on the current tape.
  Camera::FilmPoint<Var> moving(const FilmPosition& position) const;

  // sums: by slot. Takes those of the corners to what their motions are linear in.
  void gather(std::vector<double>& sums) const;

 private:
  // What a ray through a position met.
  struct Sight {
    float x, y;
    FaceRef face;
    FilmPosition at() const { return {x, y}; }
  };
  FilmField(const Scene& scene, const SceneSlots& slots);
  size_t index(int column, int row) const {
    return static_cast<size_t>(row) * (width_ + 1) + column;
  }
  // Rays through a pixel: adds what moves of what they meet.
  double look(const PathContext& context, size_t pixel, std::vector<Sight>& sights) const;
  void take_slots(const std::vector<double>& detail, double least, ParameterSlots& slots);
  bool follows(FaceRef face) const;
  void gather_sight(const Sight& sight, double along_x, double along_y,
                    std::vector<double>& sums) const;

  const Scene& scene_;
  const SceneSlots& scene_slots_;
  int width_, height_;
  std::vector<uint32_t> slots_;  // of each corner
  std::vector<double> weights_;  // of each: the sum of phi_i over sights
  std::vector<Sight> sights_;
};

// The camera's ray through a position, with what moves it on the current tape. field: may be null.
CameraRay<Var> moving_ray(const Scene& scene, const FilmField* field, const FilmPlace& place);

}  // namespace limn
