#pragma once
// A scene file as objects with typed properties, before interpretation.
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "src/scene_file/scene_tree.h"
#include "src/scene_file/scene_values.h"

namespace limn {

struct DescribedProperty {
  std::string tag;  // "float", "rgb", ...
  PropertyValue value;
  SourceLocation where;
};

struct ObjectDescription;

// A nested object or a reference.
struct ChildDescription {
  std::shared_ptr<ObjectDescription> object;  // null until a reference is resolved
  std::string reference;                      // "" if written in place
  SourceLocation where;
  std::string name;  // of the parameter that it gives; "" if none
};

struct ObjectDescription {
  std::string tag;   // "bsdf"
  std::string type;  // "diffuse"
  std::string id;    // "" if none
  SourceLocation where;
  std::map<std::string, DescribedProperty> properties;
  std::vector<ChildDescription> children;
  // An error of this object, or of one that it needs, is reported: it is not read further.
  mutable bool failed = false;
};

struct SceneDescription {
  SceneDescription() = default;
  SceneDescription(SceneDescription&&) = default;
  // Breaks reference cycles (an error in the file), which would never be freed.
  ~SceneDescription() {
    for (const auto& object : with_id) object->children.clear();
  }

  std::string file;
  SourceLocation where;                                     // of <scene>
  std::vector<std::shared_ptr<ObjectDescription>> objects;  // directly under <scene>, in order
  std::vector<std::shared_ptr<ObjectDescription>> with_id;  // every object that has one, in order
  std::vector<std::string> search_path;
  std::vector<SourceLocation> media;  // of shapes and sensors, which are not described
  std::vector<std::string> warnings;
  std::vector<std::string> files;  // the scene file and what it includes
};

// Parses a scene file and resolves all references. Unknown elements, attributes and references,
// and duplicate ids and properties, go to `errors`; InputError where nothing is left to describe.
// Objects that failed are there without what failed. text: see load_scene_tree().
SceneDescription describe_scene(const std::string& file, const SceneInput& input,
                                const std::string* text, ErrorList& errors);

// Gives shapes and emitters without an id one, by which parameters find them: the name of the mesh
// file or the type ("sphere", "sphere_1", ...). What stands inside of a shape gets the shape's id
// with ".bsdf" or ".emitter", as in the keys of Mitsuba's traverse(). Area emitters outside of
// shapes are for references: they keep theirs.
void name_objects(SceneDescription& description);

}  // namespace limn
