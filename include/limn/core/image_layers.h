#pragma once
// EXR files of several layers.
#include <string>
#include <vector>

#include "limn/core/image.h"

namespace limn {

// A layer's channels are named NAME.A, NAME.B, ...
struct ImageLayer {
  std::string name;
  std::string channels;  // "XYZ": one letter for each channel of the image, in alphabetical order
  Image image;
};
// As write_exr(), in single precision. layers: of one size, at least one.
void write_exr_layers(const std::string& file, const std::vector<ImageLayer>& layers,
                      const std::vector<ImageAttribute>& attributes);

}  // namespace limn
