#pragma once
// The report of a folder, made by tools/report.py.
#include <string>

namespace limn {

// Makes FOLDER/report.html with Python, or says what is missing for it.
void write_report(const std::string& folder, bool quiet);

}  // namespace limn
