// Widths of columns, and lines of cells.
#include "tools/limn/table.h"

#include <fmt/format.h>

#include <algorithm>

namespace limn {

std::vector<size_t> Table::widths() const {
  std::vector<size_t> widths;
  for (const Column& column : columns_)
    widths.push_back(std::max(column.heading.size(), column.least_width));
  for (const Row& row : rows_) {
    if (row.size() == 2 && row[1] == kWholeLine) continue;
    for (size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  return widths;
}

std::string Table::line_of(const Row& cells, const std::vector<size_t>& widths) const {
  std::string line;
  for (size_t i = 0; i < cells.size(); ++i) {
    if (i > 0) line += "  ";
    line += columns_[i].is_text ? fmt::format("{:<{}}", cells[i], widths[i])
                                : fmt::format("{:>{}}", cells[i], widths[i]);
  }
  line.erase(line.find_last_not_of(' ') + 1);
  return line + '\n';
}

std::string Table::line(const Row& cells) const { return line_of(cells, widths()); }

std::string Table::heading_line() const {
  Row headings;
  for (const Column& column : columns_) headings.push_back(column.heading);
  return line(headings);
}

std::string Table::text() const {
  const std::vector<size_t> all = widths();
  std::string text = heading_line();
  for (const Row& row : rows_) {
    const bool whole = row.size() == 2 && row[1] == kWholeLine;
    text += whole ? row[0] + '\n' : line_of(row, all);
  }
  return text;
}

}  // namespace limn
