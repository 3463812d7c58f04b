// Converts a mesh as read from a file to a checked mesh: transform, weld, repair, normals.
#include "src/mesh/mesh_build.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace limn {

namespace {

void warn(std::vector<std::string>* warnings, const SourceLocation& where,
          const std::string& text) {
  if (warnings) warnings->push_back(format_warning(where, text));
}

void set_positions(Mesh& mesh, const RawMesh& raw, const Matrix4& to_world) {
  mesh.positions.reserve(raw.positions.size() + 1);  // Embree reads beyond the last, too
  for (size_t i = 0; i < raw.positions.size(); ++i) {
    const Vec3d p = to_world.point(raw.positions[i]);
    for (int k = 0; k < 3; ++k) {
      if (std::fabs(p[k]) <= kLargestCoordinate) continue;
      throw InputError(i == raw.far_position ? raw.far_where : raw.where,
                       "vertex " + std::to_string(i) +
                           " (counted from 0) has a coordinate beyond 2e12, where "
                           "rays miss it in single precision: use a larger unit");
    }
    mesh.positions.push_back(cast<float>(p));
  }
}

// uv_places may hold what no face uses.
void check_uv(const RawMesh& raw) {
  constexpr float kLargest = 1e9;  // far beyond where floats have a fraction
  for (const FaceIndices& face : raw.uv_ids) {
    for (const uint32_t i : face) {
      const Vec3f& uv = raw.uv_places[i];
      if (std::fabs(uv.x) <= kLargest && std::fabs(uv.y) <= kLargest) continue;
      throw InputError(raw.where, "texture coordinate " + std::to_string(i) +
                                      " (counted from 0) is not finite or beyond 1e9");
    }
  }
}

void set_faces(Mesh& mesh, const RawMesh& raw, bool flip) {
  mesh.faces = raw.faces;
  if (mesh.normal_source == NormalSource::kGiven) mesh.normal_ids = raw.normal_ids;
  if (!flip) return;
  for (auto* corners : {&mesh.faces, &mesh.normal_ids, &mesh.uv_ids}) {
    for (FaceIndices& ids : *corners) std::swap(ids[1], ids[2]);
  }
}

// Returns how many faces were dropped.
template <class Keep>
size_t keep_faces(Mesh& mesh, const Keep& keep) {
  size_t kept = 0;
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    if (!keep(f)) continue;
    for (auto* corners : {&mesh.faces, &mesh.normal_ids, &mesh.uv_ids}) {
      if (!corners->empty()) (*corners)[kept] = (*corners)[f];
    }
    if (!mesh.file_faces.empty()) mesh.file_faces[kept] = mesh.file_faces[f];
    ++kept;
  }
  const size_t dropped = mesh.faces.size() - kept;
  for (auto* corners : {&mesh.faces, &mesh.normal_ids, &mesh.uv_ids}) {
    if (!corners->empty()) corners->resize(kept);
  }
  if (!mesh.file_faces.empty()) mesh.file_faces.resize(kept);
  return dropped;
}

// The representative of all vertices that are welded to v, directly or indirectly.
uint32_t root_of(const Mesh& mesh, uint32_t v) {
  while (mesh.weld[v] != v) v = mesh.weld[v];
  return v;
}

// Merges corners of a face that are closer than a billionth of its longest side. Such a face
// is invisible, and double precision cannot resolve its sides, so its edges would not
// cancel.
void weld_needles(Mesh& mesh) {
  constexpr double kThin = 0x1.0p-30;  // not tuned
  const auto position = [&](uint32_t v) { return cast<double>(mesh.positions[v]); };
  bool found = false;
  for (const FaceIndices& face : mesh.faces) {
    double squares[3];
    for (int k = 0; k < 3; ++k)
      squares[k] = length_squared(position(face[(k + 1) % 3]) - position(face[k]));
    const double longest = *std::max_element(squares, squares + 3);
    for (int k = 0; k < 3; ++k) {
      if (squares[k] > kThin * kThin * longest) continue;
      const uint32_t a = root_of(mesh, face[k]), b = root_of(mesh, face[(k + 1) % 3]);
      mesh.weld[std::max(a, b)] = std::min(a, b);
      found = true;
    }
  }
  if (!found) return;
  for (uint32_t v = 0; v < mesh.weld.size(); ++v) mesh.weld[v] = root_of(mesh, v);
}

// Removes faces with two corners at one position.
void drop_collapsed(Mesh& mesh) {
  mesh.collapsed_faces += keep_faces(mesh, [&](size_t f) {
    const FaceIndices& face = mesh.faces[f];
    const uint32_t a = mesh.weld[face[0]], b = mesh.weld[face[1]], c = mesh.weld[face[2]];
    return a != b && b != c && c != a;
  });
}

// Removes faces with the corners and orientation of an earlier face: rays could hit either.
size_t drop_repeated(Mesh& mesh) {
  std::vector<std::pair<FaceIndices, uint32_t>> faces;
  faces.reserve(mesh.faces.size());
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    FaceIndices face = mesh.faces[f];
    for (uint32_t& v : face) v = mesh.weld[v];
    std::rotate(face.begin(), std::min_element(face.begin(), face.end()), face.end());
    faces.push_back({face, f});
  }
  std::sort(faces.begin(), faces.end());
  std::vector<bool> repeats(faces.size());
  for (size_t i = 1; i < faces.size(); ++i)
    if (faces[i].first == faces[i - 1].first) repeats[faces[i].second] = true;
  return keep_faces(mesh, [&](size_t f) { return !repeats[f]; });
}

Vec3d doubled_area(const Mesh& mesh, size_t face) {
  const FaceIndices& f = mesh.faces[face];
  const Vec3d p = cast<double>(mesh.positions[f[0]]);
  return cross(cast<double>(mesh.positions[f[1]]) - p, cast<double>(mesh.positions[f[2]]) - p);
}

// Normals in world space. A corner without a valid normal (missing, zero or not finite) gets the
// face normal.
void set_given_normals(Mesh& mesh, const RawMesh& raw, const MeshOptions& options,
                       std::vector<std::string>* warnings) {
  std::vector<bool> usable(raw.normals.size());
  for (size_t i = 0; i < raw.normals.size(); ++i) {
    Vec3d n = options.to_world.normal(raw.normals[i]);
    const double size = length(n);
    usable[i] = size > 0 && std::isfinite(size);
    if (usable[i]) n = n * ((options.flip_normals ? -1 : 1) / size);
    mesh.normals.push_back(n);
  }
  uint64_t mended = 0;
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    uint32_t face_normal = kNoNormal;
    for (uint32_t& id : mesh.normal_ids[f]) {
      if (id != kNoNormal && usable[id]) continue;
      if (face_normal == kNoNormal) {
        const Vec3d n = doubled_area(mesh, f);
        face_normal = static_cast<uint32_t>(mesh.normals.size());
        mesh.normals.push_back(length(n) > 0 ? normalize(n) : Vec3d{0, 0, 1});
        ++mended;
      }
      id = face_normal;
    }
  }
  // Unused normals must be unit vectors, too.
  for (size_t i = 0; i < usable.size(); ++i) {
    if (!usable[i]) mesh.normals[i] = {0, 0, 1};
  }
  if (mended > 0) {
    warn(warnings, raw.where,
         std::to_string(mended) +
             " faces have corners without a usable normal: the face's own "
             "normal is used there");
  }
}

// Warns about normals that point away from their faces: the surface would look black or
// transparent.
void check_orientation(const Mesh& mesh, const SourceLocation& where,
                       std::vector<std::string>* warnings) {
  uint64_t opposed = 0, counted = 0;
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    const Vec3d area = doubled_area(mesh, f);
    if (length_squared(area) == 0) continue;
    ++counted;
    Vec3d sum;
    for (uint32_t n : mesh.normal_ids[f]) sum += mesh.normals[n];
    if (dot(sum, area) < 0) ++opposed;
  }
  if (opposed == 0) return;
  const bool nearly_all = opposed * 20 >= counted * 19;
  warn(warnings, where,
       "the vertex normals oppose the winding of " +
           (nearly_all ? "(nearly) all faces; the file is inside out for one of the two"
                       : std::to_string(opposed) + " of " + std::to_string(counted) + " faces"));
}

// In most scans and models it is below 0.3 %.
void check_light(const Mesh& mesh, const SourceLocation& where,
                 std::vector<std::string>* warnings) {
  constexpr double kMost = 0.02;
  const double lost = warnings ? lost_light(mesh) : 0;
  if (lost <= kMost) return;
  warn(warnings, where,
       fmt::format("faces block {:.2g} % of uniform light from the smooth surface that their "
                   "normals describe (in concave parts): use a finer mesh or face_normals",
                   100 * lost));
}

// Welds vertices and removes invalid faces, given positions, faces and normal indices.
void mend(Mesh& mesh, const SourceLocation& where, std::vector<std::string>* warnings) {
  const std::string all = std::to_string(mesh.faces.size());
  weld_positions(mesh);
  drop_collapsed(mesh);
  weld_seams(mesh);
  weld_needles(mesh);
  drop_collapsed(mesh);
  if (mesh.faces.empty()) {
    throw InputError(where, "the mesh has no faces: each of its " + all +
                                " faces has two corners at the same position");
  }
  if (mesh.collapsed_faces > 0) {
    warn(warnings, where,
         std::to_string(mesh.collapsed_faces) + " of " + all +
             " faces have two corners at the same position and are left out");
  }
  if (const size_t repeated = drop_repeated(mesh); repeated > 0) {
    warn(warnings, where,
         std::to_string(repeated) + " of " + all + " faces repeat another face and are left out");
  }
}

void check_positions(const Mesh& mesh, const SourceLocation& where) {
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      if (std::fabs(mesh.positions[i][k]) <= static_cast<float>(kLargestCoordinate)) continue;
      throw InputError(where, "vertex " + std::to_string(i) +
                                  " (counted from 0) has a coordinate that is not finite or "
                                  "beyond 2e12");
    }
  }
}

}  // namespace

bool mirrors(const Matrix4& to_world) {
  const auto& m = to_world.m;
  return determinant(Vec3d{m[0][0], m[0][1], m[0][2]}, Vec3d{m[1][0], m[1][1], m[1][2]},
                     Vec3d{m[2][0], m[2][1], m[2][2]}) < 0;
}

Mesh build_mesh(const RawMesh& raw, const MeshOptions& options,
                std::vector<std::string>* warnings) {
  Mesh mesh;
  mesh.normal_source = options.face_normals     ? NormalSource::kFace
                       : raw.normal_ids.empty() ? NormalSource::kComputed
                                                : NormalSource::kGiven;
  if (raw.positions.empty()) throw InputError(raw.where, "the mesh has no vertices");
  if (raw.faces.empty()) throw InputError(raw.where, "the mesh has no faces");
  set_positions(mesh, raw, options.to_world);
  mesh.textured = options.textured;
  mesh.has_tangents = options.tangents;
  if (mesh.textured) {
    check_uv(raw);
    mesh.uv_source = raw.uv_source;
    mesh.uv_places = raw.uv_places;
    mesh.uv_ids = raw.uv_ids;
    if (options.file_faces) {
      mesh.file_faces.resize(raw.faces.size());
      std::iota(mesh.file_faces.begin(), mesh.file_faces.end(), 0u);
    }
  }
  const bool given = mesh.normal_source == NormalSource::kGiven;
  set_faces(mesh, raw, options.flip_normals != (given && mirrors(options.to_world)));
  mend(mesh, raw.where, warnings);
  if (given) {
    set_given_normals(mesh, raw, options, warnings);
    check_orientation(mesh, raw.where, warnings);
  }
  if (const size_t cancelled = fill_shading_normals(mesh); cancelled > 0) {
    warn(warnings, raw.where,
         "at " + std::to_string(cancelled) +
             " vertices the normals of adjacent faces cancel: the normal of one face is used, and "
             "the derivative ignores the others");
  }
  check_light(mesh, raw.where, warnings);
  return mesh;
}

Mesh make_mesh(std::vector<Vec3f> positions, std::vector<FaceIndices> faces, bool face_normals,
               const SourceLocation& where, std::vector<std::string>* warnings) {
  if (positions.empty()) throw InputError(where, "the mesh has no vertices");
  if (faces.empty()) throw InputError(where, "the mesh has no faces");
  for (size_t f = 0; f < faces.size(); ++f) {
    const uint32_t largest = *std::max_element(faces[f].begin(), faces[f].end());
    if (largest < positions.size()) continue;
    throw InputError(where, "face " + std::to_string(f) + " (counted from 0) names vertex " +
                                std::to_string(largest) + " of " +
                                std::to_string(positions.size()));
  }
  Mesh mesh;
  mesh.normal_source = face_normals ? NormalSource::kFace : NormalSource::kComputed;
  mesh.faces = std::move(faces);
  return moved_mesh(mesh, std::move(positions), where, warnings);
}

Mesh moved_mesh(const Mesh& mesh, std::vector<Vec3f> positions, const SourceLocation& where,
                std::vector<std::string>* warnings) {
  Mesh moved;
  moved.normal_source = mesh.normal_source;
  moved.positions = std::move(positions);
  moved.faces = mesh.faces;
  moved.textured = mesh.textured;
  moved.has_tangents = mesh.has_tangents;
  moved.uv_source = mesh.uv_source;
  moved.uv_places = mesh.uv_places;
  moved.uv_ids = mesh.uv_ids;
  moved.attributes = mesh.attributes;
  moved.file_faces = mesh.file_faces;
  if (mesh.normal_source == NormalSource::kGiven) {
    moved.normals = mesh.normals;
    moved.normal_ids = mesh.normal_ids;
  }
  check_positions(moved, where);
  mend(moved, where, warnings);
  update_shading_normals(moved);
  return moved;
}

}  // namespace limn
