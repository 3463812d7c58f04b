// limn_generate: writes the meshes, skies and textures that scenes/ uses.
#include "tools/generate/generate.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>

namespace limn {
namespace {

struct Options {
  std::string name, file, all;
  int faces = 0;
  bool list = false;
};

void list() {
  fmt::print("meshes ({} faces at most):\n", kMostFaces);
  for (const MeshKind& kind : mesh_kinds()) {
    fmt::print("  {:<12} {} faces ({} at least): {}\n", kind.name, kind.default_faces,
               kind.fewest_faces, kind.description);
  }
  fmt::print("skies (EXR):\n");
  for (const ImageKind& kind : sky_kinds()) {
    fmt::print("  {:<12} {}\n", kind.name, kind.description);
  }
  fmt::print("textures (PNG or EXR):\n");
  for (const ImageKind& kind : texture_kinds()) {
    fmt::print("  {:<12} {}\n", kind.name, kind.description);
  }
}

void write_mesh(const MeshKind& kind, int faces, const std::string& file) {
  if (faces < kind.fewest_faces || faces > kMostFaces) {
    throw InputError(fmt::format("--faces {}: {} takes {} to {}", faces, kind.name,
                                 kind.fewest_faces, kMostFaces));
  }
  const Triangles mesh = make_mesh(kind, faces);
  write_triangles(file, mesh);
  fmt::print("{}: {} faces, {} vertices\n", file, mesh.faces.size(), mesh.positions.size());
}

void write_image(const ImageKind& kind, const std::string& file) {
  const Image image = kind.make();
  if (file.ends_with(".png")) {
    write_png(file, image, 1);
  } else {
    write_exr(file, image, true, {});
  }
  fmt::print("{}: {} x {}\n", file, image.width, image.height);
}

void write_all(const std::string& folder, int faces) {
  std::filesystem::create_directories(folder);
  for (const MeshKind& kind : mesh_kinds()) {
    const int count = faces > 0 ? std::max(faces, kind.fewest_faces) : kind.default_faces;
    write_mesh(kind, count, fmt::format("{}/{}.ply", folder, kind.name));
  }
  for (const ImageKind& kind : sky_kinds()) {
    write_image(kind, fmt::format("{}/{}.exr", folder, kind.name));
  }
  for (const ImageKind& kind : texture_kinds()) {
    write_image(kind, fmt::format("{}/{}.png", folder, kind.name));
  }
}

void write_one(const Options& options) {
  const auto named = [&](const auto& kind) { return kind.name == options.name; };
  const auto meshes = mesh_kinds();
  const auto skies = sky_kinds();
  const auto textures = texture_kinds();
  if (const auto kind = std::ranges::find_if(meshes, named); kind != meshes.end()) {
    write_mesh(*kind, options.faces > 0 ? options.faces : kind->default_faces, options.file);
  } else if (const auto sky = std::ranges::find_if(skies, named); sky != skies.end()) {
    if (options.faces > 0) throw InputError(options.name + " is a sky: it takes no --faces");
    write_image(*sky, options.file);
  } else if (const auto texture = std::ranges::find_if(textures, named);
             texture != textures.end()) {
    if (options.faces > 0) throw InputError(options.name + " is a texture: it takes no --faces");
    write_image(*texture, options.file);
  } else {
    throw InputError("nothing is called \"" + options.name + "\"; limn_generate --list shows all");
  }
}

int run(int argc, char** argv) {
  CLI::App app(
      "Writes the meshes, skies and textures that the scenes use, the same bytes every time.");
  Options options;
  app.add_option("NAME", options.name, "what to make, see --list");
  app.add_option("FILE", options.file,
                 "a mesh: .ply or .obj; a sky: .exr; a texture: .png or .exr");
  app.add_option("--faces", options.faces, "about how many triangles")
      ->check(CLI::Range(1, kMostFaces));
  app.add_option("--all", options.all, "write everything into this folder");
  app.add_flag("--list", options.list, "list what can be made");
  CLI11_PARSE(app, argc, argv);
  if (options.list) {
    list();
  } else if (!options.all.empty()) {
    write_all(options.all, options.faces);
  } else if (options.file.empty()) {
    throw InputError("give NAME and FILE, or --all FOLDER, or --list");
  } else {
    write_one(options);
  }
  return 0;
}

}  // namespace
}  // namespace limn

int main(int argc, char** argv) {
  try {
    return limn::run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "limn_generate: {}\n", error.what());
    return 2;
  }
}
