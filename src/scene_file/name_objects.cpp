// Names for the objects of a scene file that have no id.
#include <filesystem>
#include <map>
#include <set>

#include "src/scene_file/scene_description.h"

namespace limn {

namespace {

// The mesh file's name without its folder and extension, or the type.
std::string stem_of(const ObjectDescription& shape) {
  const auto found = shape.properties.find("filename");
  const auto* file =
      found == shape.properties.end() ? nullptr : std::get_if<std::string>(&found->second.value);
  std::string stem = file ? std::filesystem::path(*file).stem().string() : "";
  for (char& c : stem) {
    // A parameter's name has dots between its parts.
    if (c == '.' || c == ':' || c == ' ') c = '_';
  }
  return stem.empty() ? shape.type : stem;
}

// Gives names that no id of the file has: a stem, then the stem with _1, _2, ...
class Namer {
 public:
  explicit Namer(const SceneDescription& description) {
    for (const auto& object : description.with_id) taken_.insert(object->id);
  }

  void name(ObjectDescription& object) {
    if (object.tag == "shape") {
      name_shape(object);
    } else if (object.tag == "emitter" && object.type != "area" && object.id.empty()) {
      object.id = unused(object.type);
    }
  }

 private:
  std::string unused(const std::string& stem) {
    int& count = counts_[stem];
    while (true) {
      const std::string id = count == 0 ? stem : stem + "_" + std::to_string(count);
      ++count;
      if (taken_.insert(id).second) return id;
    }
  }

  void name_shape(ObjectDescription& shape) {
    const bool is_mesh = shape.type != "shapegroup" && shape.type != "instance";
    if (is_mesh && shape.id.empty()) shape.id = unused(stem_of(shape));
    for (ChildDescription& child : shape.children) {
      ObjectDescription& object = *child.object;
      // What a reference names has an id.
      if (!child.reference.empty()) continue;
      if (object.tag == "shape") name_shape(object);
      if ((object.tag == "bsdf" || object.tag == "emitter") && object.id.empty()) {
        object.id = shape.id + "." + object.tag;
      }
    }
  }

  std::set<std::string> taken_;
  std::map<std::string, int> counts_;
};

}  // namespace

void name_objects(SceneDescription& description) {
  Namer namer(description);
  for (const auto& object : description.objects) namer.name(*object);
}

}  // namespace limn
