#pragma once
// Typed access to the properties of one element of a scene file. A property that is never
// read, or a nested object that is never used, is an error; the message lists the known
// names.
#include <memory>
#include <string>
#include <vector>

#include "limn/core/dual.h"
#include "limn/core/error.h"
#include "limn/core/matrix.h"
#include "limn/core/vec.h"

namespace limn {

class Bsdf;
class Texture;

// What a constant colour stands for where a number is expected: its mean, as in Mitsuba (of a
// bitmap it is the luminance).
inline double number_of(const Rgb<double>& c) { return (c.r + c.g + c.b) / 3; }

class Properties {
 public:
  virtual ~Properties() = default;

  virtual const std::string& tag() const = 0;   // "bsdf", "emitter", ...
  virtual const std::string& type() const = 0;  // "diffuse", ...
  virtual const std::string& id() const = 0;    // "" if none
  virtual const SourceLocation& where() const = 0;
  // Location of the property `name`; of the element if the property is absent.
  virtual SourceLocation where(const std::string& name) const = 0;

  virtual bool has(const std::string& name) const = 0;
  // True if the property is a <string>.
  virtual bool has_text(const std::string& name) const = 0;
  // Returns `absent` if there is no such property. InputError at its location if it has another
  // type.
  virtual double number(const std::string& name, double absent) = 0;
  virtual int64_t integer(const std::string& name, int64_t absent) = 0;
  virtual bool boolean(const std::string& name, bool absent) = 0;
  virtual std::string string(const std::string& name, const std::string& absent) = 0;
  virtual Vec3d point(const std::string& name, const Vec3d& absent) = 0;
  // <rgb>, <float> as grey, or a spectrum, by what the property is used for.
  virtual Rgb<double> rgb(const std::string& name, const Rgb<double>& absent) = 0;
  virtual Matrix4 transform(const std::string& name) = 0;  // identity when absent
  // A file name resolved against the search path. InputError if the property is absent or no such
  // file exists.
  virtual std::string file(const std::string& name) = 0;
  // What objects of the scene share of a file, by a name for both; null until one of them sets it.
  virtual std::shared_ptr<const void>& shared(const std::string& name) = 0;
  // The nested texture (or reference to one) of this name, made anew; null if there is none.
  virtual std::shared_ptr<Texture> texture(const std::string& name) = 0;
  // The only nested texture, of any name; null if there is none. InputError if there are several.
  virtual std::shared_ptr<Texture> only_texture() = 0;
  // Nested bsdf elements and references to bsdfs, in order.
  virtual std::vector<std::shared_ptr<Bsdf>> bsdfs() = 0;

  // A number where a texture may stand: a number, or a colour, of which number_of.
  double number_or_colour(const std::string& name, double absent) {
    return number_of(rgb(name, grey(absent)));
  }

  // The roughness that smooth lobes are given; 0: they are smooth.
  virtual double smooth_as() const { return 0; }

  // Throws an InputError at this element, or at one of its properties.
  [[noreturn]] void fail(const std::string& message) const;
  [[noreturn]] void fail(const std::string& property, const std::string& message) const;
};

}  // namespace limn
