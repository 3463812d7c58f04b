// A film in tiles.
#include "integrators/estimates/tiles.h"

#include <algorithm>

namespace limn {

std::vector<Tile> make_tiles(const Film& film) {
  std::vector<Tile> tiles;
  const int right = film.crop_x + film.crop_width;
  const int bottom = film.crop_y + film.crop_height;
  for (int y = film.crop_y; y < bottom; y += kTileSize) {
    for (int x = film.crop_x; x < right; x += kTileSize) {
      tiles.push_back({x, y, std::min(x + kTileSize, right), std::min(y + kTileSize, bottom)});
    }
  }
  return tiles;
}

}  // namespace limn
