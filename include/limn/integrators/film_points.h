#pragma once
// Where on the film the method `analytic` looks, whose light is known in closed form.
#include <string>

#include "limn/integrators/run.h"

namespace limn {

enum class FilmPoints {
  kRandom,  // samples, as every method
  // One point for each face that a pixel shows, at the centroid of what is seen of it, times the
  // area of that: no chance is left, and an image is a continuous function of the scene whose exact
  // derivative is the one returned, silhouettes in view included. How far it is off falls with
  // the size of a pixel (integrators/film/README.md). Needs a box filter. Numbers of samples, seeds
  // and limits of time are not looked at.
  kFaces
};
inline constexpr const char* kFilmPoints[] = {"random", "faces"};  // by their numbers
inline const char* name_of(FilmPoints points) { return kFilmPoints[static_cast<int>(points)]; }

// InputError for others than random where light is not in closed form. method: the one requested.
void check_points(FilmPoints points, bool closed_light, const std::string& method);

// Those of a run over these points: of faces there is one pass, and no limit of time. InputError
// for a part of a run over faces.
RunSettings settings_for(FilmPoints points, RunSettings settings);

}  // namespace limn
