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

// `moved`, of whose map the texels alone may differ from those of `unmoved`, with directions drawn
// as by `unmoved`. An environment without a map is left as it is.
std::shared_ptr<Environment> drawn_alike(const std::shared_ptr<Environment>& moved,
                                         const Environment& unmoved);

}  // namespace limn
