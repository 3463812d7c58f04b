#pragma once
// Gradients that are wrong on purpose, for tests of the check.
#include <string>

#include "limn/integrators/check.h"
#include "support/scenes.h"

namespace limn {

// A check of a gradient with a known defect.
struct Planted {
  std::string name;
  Scene scene;
  CheckOptions options;
  int spp = 0;
  GradientRun run;
  double size = 0;                 // of the defect, as a part of the term; 0: not known
  std::vector<std::string> terms;  // which it is in
};

// A gradient with one of its terms scaled.
GradientRun scaled_term(const std::string& term, double factor);
// A term of a small scene with a ball, a floor and a lamp, scaled.
Planted planted_term(const TempFiles& files, const std::string& method, const std::string& term,
                     double factor, int spp);
// The same with a small tile that moves with the ball, away from another one at its side.
Planted planted_beside_kink(const TempFiles& files, const std::string& method,
                            const std::string& term, double factor, int spp);
// A term of one of scenes/closed_form (without .xml), scaled. These have few pixels.
Planted planted_in_closed_form(const std::string& file, const std::string& parameter,
                               const std::string& method, const std::string& term, double factor,
                               int spp);
// An open leaf and a cube in one mesh that moves: the leaf's edges, all of which are borders, are
// left out.
Planted planted_border(const TempFiles& files, int spp);
// A mesh with computed normals whose derivative is left out.
Planted planted_normals(const TempFiles& files, int spp);

}  // namespace limn
