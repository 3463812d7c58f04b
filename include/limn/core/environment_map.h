#pragma once
// Environment maps made from images in memory.
#include <memory>
#include <string>

#include "limn/core/environment.h"

namespace limn {

// A map of one or three channels, all finite, rotated as by <rotate y="1"/> [degrees]. file: its
// name for describe().
std::shared_ptr<Environment> make_map_environment(const Image& image, double scale, double turn,
                                                  const std::string& file);

}  // namespace limn
