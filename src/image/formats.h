#pragma once
// Readers of image formats other than EXR, one per row of the table in read_image.cpp. Files are
// hostile: sizes are checked before memory is taken.
#include <string>
#include <string_view>

#include "limn/core/image.h"

namespace limn {

// file: its name, for messages; data: all its bytes. InputError if they are no valid image.
StoredImage read_bmp(const std::string& file, std::string_view data);
StoredImage read_jpeg(const std::string& file, std::string_view data);
StoredImage read_png(const std::string& file, std::string_view data);
StoredImage read_rgbe(const std::string& file, std::string_view data);

// The alpha channel, as read_alpha() has it. Errors as above.
Image read_png_alpha(const std::string& file, std::string_view data);
Image read_exr_alpha(const std::string& file);

// InputError if a size of the header cannot be: at most kMaxPixels pixels, of which a byte of the
// file yields at most `pixels_per_byte`, and memory for that many bytes a pixel.
void check_image_size(const std::string& file, std::string_view data, uint64_t width,
                      uint64_t height, double pixels_per_byte, double bytes_per_pixel);

}  // namespace limn
