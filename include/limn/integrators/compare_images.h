#pragma once
// Images as comparisons make them: methods of images, and their reference.
#include <memory>
#include <string>

#include "limn/integrators/reference.h"
#include "limn/integrators/render.h"

namespace limn {

// Renders by `method` with what `options` has besides.
// Makes one sample first, by `settings`: InputError if the method does not know the scene, which
// must outlive it. block: pixels, of the block sums.
std::unique_ptr<TimedMethod> make_image_method(const Scene& scene, RenderOptions options,
                                               const Method& method, int block,
                                               const RunSettings& settings);

// The mean of eight runs, in settings.seconds together, whose differences tell its variance. The
// method is rays where they know the scene's light, else path, and not_by_rays says why. Without
// samples if interrupted. InputError for a black image.
Reference make_image_reference(const Scene& scene, RenderOptions options, int block,
                               const RunSettings& settings, std::string& not_by_rays);

}  // namespace limn
