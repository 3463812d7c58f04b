#pragma once
// Coverage (alpha): the share of each pixel in which the camera sees a surface, as a scene whose
// image has derivatives like any other.
#include <string>

#include "limn/core/image.h"
#include "limn/core/scene.h"

namespace limn {

// A scene whose image is the coverage of `scene` less 1, in all channels: surfaces are black,
// before a sky of radiance -1. Its parameters are those of shapes and cameras. Whatever its
// material, a surface covers what lies behind it; emitters do not with hide_emitters.
Scene coverage_of(const Scene& scene);

// A mask as a target of coverage_of(): 1 subtracted from the file's alpha channel, if it is an EXR
// or the channel is not 1 everywhere, else from the mean of its channels as they are stored (eight
// bits without sRGB's transfer function). H by W by 1; InputError as read_image(), and for values
// outside of 0 to 1.
Image read_coverage(const std::string& file);

}  // namespace limn
