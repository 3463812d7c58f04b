#pragma once
// Aligned columns for the terminal.
#include <string>
#include <vector>

namespace limn {

class Table {
 public:
  struct Column {
    std::string heading;     // with the unit of its numbers: "time [s]"
    bool is_text = false;    // aligned to the left; numbers are to the right
    size_t least_width = 0;  // where rows are printed one by one
  };
  using Row = std::vector<std::string>;

  explicit Table(std::vector<Column> columns) : columns_(std::move(columns)) {}
  // With an empty cell for every one that is missing at the end.
  void add(Row cells) { rows_.push_back(std::move(cells)); }
  // A line as it is, below the last row.
  void add_line(const std::string& line) { rows_.push_back({line, kWholeLine}); }
  // Headings and rows, each with an end of line.
  std::string text() const;
  // A row by itself, as wide as the headings ask for.
  std::string line(const Row& cells) const;
  std::string heading_line() const;

 private:
  static constexpr const char* kWholeLine = "\n";  // the second cell of such a line

  std::vector<size_t> widths() const;
  std::string line_of(const Row& cells, const std::vector<size_t>& widths) const;

  std::vector<Column> columns_;
  std::vector<Row> rows_;
};

}  // namespace limn
