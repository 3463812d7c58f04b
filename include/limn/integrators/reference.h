#pragma once
// The image that methods are measured against: from a long run, kept in files that know what they
// belong to.
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "limn/core/scene.h"
#include "limn/integrators/timed_method.h"

namespace limn {

struct Reference {
  std::vector<double> image;     // crop_height by crop_width by 3, per unit of the parameter
  std::vector<double> variance;  // of the image, the same shape
  BlockSums blocks;
  std::vector<double> edges;  // magnitude of what edges add to each block
  std::string method;
  int64_t spp = 0;  // 0: interrupted before the first pass over the image
  uint64_t seed = 0;
  double seconds = 0;
  double asked_seconds = 0;  // an interrupted run asked for what it took
  bool cached = false;       // read from a file
  NonFinite non_finite;
};

// What an image of a derivative belongs to, as (name, value) pairs: contents of the scene's files
// as hashes, defines, parameter, terms, shading, film. Equal for equal jobs wherever the
// files lie. InputError if a file cannot be read.
using Identity = std::vector<std::pair<std::string, std::string>>;
Identity identify(const MethodInput& input, const std::map<std::string, std::string>& defines);

// By the default method, which is unbiased and fast nearly everywhere, in settings.seconds but with
// at least two samples per pixel; fewer if interrupted.
Reference make_reference(const MethodInput& input, const RunSettings& settings);

// Writes `file` (an EXR) and beside it FILE_stderr.exr, which also holds the variances of the
// blocks.
void write_reference(const std::string& file, const Reference& reference, const Identity& identity,
                     const Film& film, int block);
// InputError if the file was not written by write_reference, or that of its standard errors is
// missing, or it belongs to something else: the message says what differs.
Reference read_reference(const std::string& file, const Identity& identity, const Film& film);
// The reference in `file` if there is one that belongs to this job and took at least that many
// seconds; otherwise says why not in `why`, "" if there is none.
std::optional<Reference> find_reference(const std::string& file, const Identity& identity,
                                        const Film& film, double seconds, std::string& why);

}  // namespace limn
