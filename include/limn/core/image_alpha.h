#pragma once
// The opacity that images store beside their colours.
#include <string>

#include "limn/core/image.h"

namespace limn {

// The alpha channel of a PNG or EXR image as its file stores it (1: opaque), H by W by 1; without
// pixels where the file has none, and for other formats. InputError as read_image().
Image read_alpha(const std::string& file);

// As write_exr(), with alpha (H by W by 1) as channel A.
void write_exr_with_alpha(const std::string& file, const Image& image, const Image& alpha,
                          bool half, const std::vector<ImageAttribute>& attributes);

}  // namespace limn
