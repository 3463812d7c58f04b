#pragma once
// Properties of a described object.
#include <functional>
#include <map>
#include <set>

#include "limn/core/properties.h"
#include "src/scene_file/error_list.h"
#include "src/scene_file/scene_description.h"
#include "src/scene_file/spectrum.h"

namespace limn {

// Make nested objects.
struct Makers {
  std::function<std::shared_ptr<Bsdf>(const ObjectDescription&)> bsdf;
  std::function<std::shared_ptr<Texture>(const ObjectDescription&)> texture;
  double smooth_as = 0;                                               // see Properties
  mutable std::map<std::string, std::shared_ptr<const void>> shared;  // the same
};

class DescribedProperties final : public Properties {
 public:
  // All arguments must outlive this object.
  DescribedProperties(const ObjectDescription& object, const SceneDescription& scene,
                      const Makers& make_nested)
      : object_(object), scene_(scene), make_nested_(make_nested) {}

  const std::string& tag() const override { return object_.tag; }
  const std::string& type() const override { return object_.type; }
  const std::string& id() const override { return object_.id; }
  const SourceLocation& where() const override { return object_.where; }
  SourceLocation where(const std::string& name) const override;

  bool has(const std::string& name) const override;
  bool has_text(const std::string& name) const override;
  double number(const std::string& name, double absent) override;
  int64_t integer(const std::string& name, int64_t absent) override;
  bool boolean(const std::string& name, bool absent) override;
  std::string string(const std::string& name, const std::string& absent) override;
  Vec3d point(const std::string& name, const Vec3d& absent) override;
  Rgb<double> rgb(const std::string& name, const Rgb<double>& absent) override;
  Matrix4 transform(const std::string& name) override;
  std::string file(const std::string& name) override;
  std::shared_ptr<const void>& shared(const std::string& name) override {
    return make_nested_.shared[name];
  }
  std::shared_ptr<Texture> texture(const std::string& name) override;
  std::shared_ptr<Texture> only_texture() override;
  std::vector<std::shared_ptr<Bsdf>> bsdfs() override;
  double smooth_as() const override { return make_nested_.smooth_as; }

  // Null if the property is absent or has another type.
  const Animation* animation(const std::string& name);

  // The nested object of this tag; null if there is none, InputError if there are several or if it
  // failed.
  const ObjectDescription* nested(const std::string& tag);

  // All nested objects of this tag, in order. InputError if one failed.
  std::vector<const ObjectDescription*> all_nested(const std::string& tag);
  // One number as three, a colour or a vector, as it stands in the file.
  Rgb<double> triple(const std::string& name);

  // InputErrors for all properties and nested objects that were never read, in the file's order.
  void check_all_used() const;

 private:
  // Null if absent. Records the name as known.
  const DescribedProperty* find(const std::string& name) const;
  // The texture or spectrum with this name; null if absent.
  const ObjectDescription* find_object(const std::string& name) const;
  // The path of a file that the scene names at `mentioned`. InputError if it does not exist.
  std::string existing_file(const std::string& name, const std::string& text,
                            const SourceLocation& mentioned) const;
  Rgb<double> rgb_of(const ObjectDescription& object, const std::string& name, ColourUse use);
  [[noreturn]] void fail_type(const std::string& name, const DescribedProperty& property,
                              const std::string& expected) const;

  const ObjectDescription& object_;
  const SceneDescription& scene_;
  const Makers& make_nested_;
  mutable std::set<std::string> known_;
  std::set<std::string> known_tags_;
};

// True for uniform, rawconstant, srgb, d65, regular, irregular and blackbody.
bool is_spectrum_type(const std::string& type);

// The colour of such an object. InputError for unknown, missing or unusable parameters.
Rgb<double> read_spectrum_object(DescribedProperties& properties, ColourUse use);

}  // namespace limn
