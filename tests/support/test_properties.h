#pragma once
// Properties given in code, for objects that are tested without a file.
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "limn/core/bsdf.h"
#include "limn/core/properties.h"
#include "limn/core/texture.h"

namespace limn::test {

class TestProperties final : public Properties {
 public:
  using Value = std::variant<double, bool, std::string, Vec3d, Rgb<double>, Matrix4>;

  TestProperties(std::string tag, std::string type, std::map<std::string, Value> values = {},
                 std::vector<std::shared_ptr<Bsdf>> bsdfs = {})
      : tag_(std::move(tag)),
        type_(std::move(type)),
        values_(std::move(values)),
        bsdfs_(std::move(bsdfs)) {}

  const std::string& tag() const override { return tag_; }
  const std::string& type() const override { return type_; }
  const std::string& id() const override { return id_; }
  const SourceLocation& where() const override { return where_; }
  SourceLocation where(const std::string&) const override { return where_; }

  bool has(const std::string& name) const override { return values_.count(name) > 0; }
  bool has_text(const std::string& name) const override {
    const auto found = values_.find(name);
    return found != values_.end() && std::holds_alternative<std::string>(found->second);
  }
  double number(const std::string& name, double absent) override { return get(name, absent); }
  int64_t integer(const std::string& name, int64_t absent) override {
    return static_cast<int64_t>(get(name, static_cast<double>(absent)));
  }
  bool boolean(const std::string& name, bool absent) override { return get(name, absent); }
  std::string string(const std::string& name, const std::string& absent) override {
    return get(name, absent);
  }
  Vec3d point(const std::string& name, const Vec3d& absent) override { return get(name, absent); }
  Rgb<double> rgb(const std::string& name, const Rgb<double>& absent) override {
    const auto found = values_.find(name);
    if (found != values_.end() && std::holds_alternative<double>(found->second)) {
      return grey(std::get<double>(found->second));
    }
    return get(name, absent);
  }
  Matrix4 transform(const std::string& name) override { return get(name, Matrix4{}); }
  std::string file(const std::string& name) override { return get(name, std::string{}); }
  std::shared_ptr<const void>& shared(const std::string& name) override { return of_files[name]; }
  std::shared_ptr<Texture> texture(const std::string& name) override {
    const auto found = textures.find(name);
    return found == textures.end() ? nullptr : found->second;
  }
  std::shared_ptr<Texture> only_texture() override {
    return textures.empty() ? nullptr : textures.begin()->second;
  }
  std::vector<std::shared_ptr<Bsdf>> bsdfs() override { return bsdfs_; }
  double smooth_as() const override { return roughness; }

  std::map<std::string, std::shared_ptr<Texture>> textures;
  double roughness = 0;  // see smooth_as
  std::map<std::string, std::shared_ptr<const void>> of_files;

 private:
  template <class T>
  T get(const std::string& name, const T& absent) const {
    const auto found = values_.find(name);
    return found == values_.end() ? absent : std::get<T>(found->second);
  }

  std::string tag_, type_, id_;
  SourceLocation where_{"test.xml", 3, 5};
  std::map<std::string, Value> values_;
  std::vector<std::shared_ptr<Bsdf>> bsdfs_;
};

}  // namespace limn::test
