// Converts the XML tree to objects with typed properties: ids, aliases, references.
#include "src/scene_file/scene_description.h"

#include <algorithm>
#include <set>

#include "limn/core/names.h"

namespace limn {

namespace {

// Directly under <scene> or nested. Those that a scene cannot hold wait there for a <ref>.
const std::vector<std::string> kObjectTags = {"bsdf",     "emitter", "film",   "integrator",
                                              "rfilter",  "sampler", "sensor", "shape",
                                              "spectrum", "texture"};

// Read by name alone, for integrators that ignore it.
constexpr char kMedium[] = "medium";
const std::vector<std::string> kWithMedia = {"emitter", "sensor", "shape"};

constexpr size_t kMaxAliases = 64;  // in a chain of aliases; not tuned

bool contains(const std::vector<std::string>& words, const std::string& word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

class Describer {
 public:
  explicit Describer(ErrorList& errors) : errors_(errors) {}

  SceneDescription describe(const SceneTree& tree, const std::string& file) {
    const XmlElement& root = tree.root;
    if (root.name != "scene") {
      throw InputError(root.where, "the root element must be <scene>, not <" + root.name + ">");
    }
    scene_.file = file;
    scene_.where = root.where;
    scene_.search_path = tree.search_path;
    scene_.files = tree.files;
    scene_.warnings = tree.warnings;
    for (const XmlElement& child : root.children) {
      read(child, [&] { add_to_scene(child); });
    }
    for (const auto& object : all_objects_) resolve(*object);
    for (const XmlAttribute& id : root_references_) {
      errors_.keep([&] { add_reference(find(id.value, id.where)); });
    }
    for (const auto& alias : aliases_) {
      errors_.keep([&] { find(alias.second.value, alias.second.where); });
    }
    return std::move(scene_);
  }

 private:
  // Runs a step that reads `element`. If it fails, references to what is inside report nothing.
  template <class Step>
  bool read(const XmlElement& element, const Step& step) {
    const bool is_read = errors_.keep([&] {
      if (element.failed) throw InputErrors();
      step();
    });
    if (!is_read) forgive_references(element);
    return is_read;
  }

  void forgive_references(const XmlElement& element) {
    const XmlAttribute* id = element.find(element.name == "alias" ? "as" : "id");
    if (id && element.name != "ref") reported_ids_.insert(id->value);
    for (const XmlElement& child : element.children) forgive_references(child);
  }

  void add_to_scene(const XmlElement& element) {
    if (element.name == "alias") {
      add_alias(element);
    } else if (element.name == "ref") {
      root_references_.push_back(reference_of(element));
    } else if (element.name == kMedium) {
      describe_object(element);
    } else if (contains(kObjectTags, element.name)) {
      scene_.objects.push_back(describe_object(element));
    } else if (is_property_tag(element.name)) {
      check_setting(element);
    } else {
      std::vector<std::string> known = kObjectTags;
      known.insert(known.end(), {"alias", "default", "include", "path", "ref"});
      std::sort(known.begin(), known.end());
      throw InputError(element.where, "<scene>: unknown element <" + element.name + "> (" +
                                          known_names(known) + ")" + advice_on(element.name));
    }
  }

  // Mitsuba's settings of ray tracing, which have no meaning here.
  static void check_setting(const XmlElement& element) {
    parse_property(element);
    const std::string& name = element.find("name")->value;
    const std::vector<std::string> known = {"allow_thread_reordering",
                                            "compact_acceleration_structures",
                                            "embree_use_robust_intersections"};
    if (!contains(known, name) && !name.starts_with("kd_")) {
      throw InputError(element.where, "<scene>: " + unknown_name("parameter", name, known));
    }
  }

  void add_alias(const XmlElement& element) {
    check_attributes(element, {"as", "id"}, {"as", "id"});
    const std::string& name = element.find("as")->value;
    check_new_id(name, element.find("as")->where);
    id_places_.emplace(name, element.find("as")->where);
    aliases_[name] = *element.find("id");
  }

  void check_new_id(const std::string& id, const SourceLocation& where) const {
    const auto earlier = id_places_.find(id);
    if (earlier == id_places_.end()) return;
    const SourceLocation& place = earlier->second;
    throw InputError(where, "the id \"" + id + "\" is taken already, at " + place.file + ":" +
                                std::to_string(place.line) + ":" + std::to_string(place.column));
  }

  std::shared_ptr<ObjectDescription> describe_object(const XmlElement& element) {
    check_attributes(element, {"id", "name", "type"}, {"type"});
    auto object = std::make_shared<ObjectDescription>();
    object->tag = element.name;
    object->type = type_of(element);
    object->where = element.where;
    if (const XmlAttribute* id = element.find("id")) {
      if (id->value.empty()) throw InputError(id->where, "the id is empty");
      check_new_id(id->value, id->where);
      id_places_.emplace(id->value, id->where);
      by_id_[id->value] = object;
      scene_.with_id.push_back(object);
      object->id = id->value;
    }
    all_objects_.push_back(object);
    if (element.name == kMedium) return object;
    for (const XmlElement& child : element.children) {
      if (!read(child, [&] { add_to_object(child, *object); })) object->failed = true;
    }
    return object;
  }

  // The name of a type in lower case: Mitsuba finds "Sphere" where file names ignore case.
  std::string type_of(const XmlElement& element) {
    const XmlAttribute& type = *element.find("type");
    const std::string name = lower_case(type.value);
    if (name != type.value) {
      scene_.warnings.push_back(
          format_warning(type.where, element.name + " type \"" + type.value + "\" is read as \"" +
                                         name + "\", which Mitsuba finds on some systems only"));
    }
    return name;
  }

  static const XmlAttribute& reference_of(const XmlElement& element) {
    check_attributes(element, {"id", "name"}, {"id"});
    if (!element.children.empty()) {
      throw InputError(element.children[0].where, "<ref> takes no elements");
    }
    return *element.find("id");
  }

  // A <ref> under <scene>: what stands there already is there once.
  void add_reference(const std::shared_ptr<ObjectDescription>& object) {
    if (std::find(scene_.objects.begin(), scene_.objects.end(), object) == scene_.objects.end()) {
      scene_.objects.push_back(object);
    }
  }

  void add_to_object(const XmlElement& element, ObjectDescription& object) {
    if (element.name == "ref") {
      const XmlAttribute& id = reference_of(element);
      object.children.push_back({nullptr, id.value, id.where, name_of(element)});
    } else if (is_property_tag(element.name) && !is_object(element)) {
      add_property(element, object);
    } else if (contains(kObjectTags, element.name) ||
               (element.name == kMedium && contains(kWithMedia, object.tag))) {
      object.children.push_back({describe_object(element), "", element.where, name_of(element)});
    } else {
      std::vector<std::string> known = kObjectTags;
      known.insert(known.end(), property_tags().begin(), property_tags().end());
      known.push_back("ref");
      std::sort(known.begin(), known.end());
      known.erase(std::unique(known.begin(), known.end()), known.end());
      throw InputError(element.where, object.tag + " \"" + object.type + "\": unknown element <" +
                                          element.name + "> (" + known_names(known) + ")" +
                                          advice_on(element.name));
    }
  }

  static std::string name_of(const XmlElement& element) {
    const XmlAttribute* name = element.find("name");
    return name ? name->value : "";
  }

  // <spectrum> is an object where it has a type, else a property.
  static bool is_object(const XmlElement& element) {
    return element.name == "spectrum" && element.find("type");
  }

  static void add_property(const XmlElement& element, ObjectDescription& object) {
    PropertyValue value = parse_property(element);
    const std::string& name = element.find("name")->value;
    const bool is_new =
        object.properties.emplace(name, DescribedProperty{element.name, value, element.where})
            .second;
    if (!is_new) {
      throw InputError(element.where, object.tag + " \"" + object.type + "\": parameter \"" + name +
                                          "\" is given twice");
    }
  }

  // An alias may name a later alias.
  std::shared_ptr<ObjectDescription> find(std::string id, SourceLocation where) {
    std::vector<std::string> followed;
    const auto fail = [&](const std::string& message) {
      reported_ids_.insert(followed.begin(), followed.end());
      throw InputError(where, message);
    };
    while (true) {
      if (followed.size() > aliases_.size()) fail("the alias \"" + id + "\" names itself");
      if (followed.size() > kMaxAliases) fail("aliases of aliases, more than 64 deep");
      const auto found = by_id_.find(id);
      if (found != by_id_.end()) return found->second;
      if (reported_ids_.count(id)) throw InputErrors();
      followed.push_back(id);
      const auto alias = aliases_.find(id);
      if (alias == aliases_.end()) break;
      id = alias->second.value;
      where = alias->second.where;
    }
    std::vector<std::string> known;
    for (const auto& [name, object] : by_id_) known.push_back(name);
    fail("there is no object with the id \"" + id + "\" (" + known_names(known, "none has one") +
         ")");
    return nullptr;
  }

  void resolve(ObjectDescription& object) {
    for (ChildDescription& child : object.children) {
      if (child.object) continue;
      const auto look = [&] { child.object = find(child.reference, child.where); };
      if (!errors_.keep(look)) object.failed = true;
    }
    std::erase_if(object.children, [&](const ChildDescription& child) {
      if (!child.object) return true;
      if (child.object->tag != kMedium) return false;
      scene_.media.push_back(child.where);
      return true;
    });
  }

  ErrorList& errors_;
  SceneDescription scene_;
  std::vector<std::shared_ptr<ObjectDescription>> all_objects_;
  std::map<std::string, std::shared_ptr<ObjectDescription>> by_id_;
  std::map<std::string, SourceLocation> id_places_;
  std::set<std::string> reported_ids_;  // that have no object, which is reported
  std::map<std::string, XmlAttribute> aliases_;
  std::vector<XmlAttribute> root_references_;
};

}  // namespace

SceneDescription describe_scene(const std::string& file, const SceneInput& input,
                                const std::string* text, ErrorList& errors) {
  SceneDescription description =
      Describer(errors).describe(load_scene_tree(file, input, text, errors), file);
  name_objects(description);
  return description;
}

}  // namespace limn
