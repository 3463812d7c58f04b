# Marks a header's comments for Doxygen: `//` above a declaration becomes `///`, beside one `///<`,
# and the comment right below `#pragma once` describes the file. Line numbers stay.
FNR == 1 {
  markdown = FILENAME ~ /\.md$/
  opening = beside = 0
}
markdown {
  print
  next
}
/^#pragma once/ {
  name = FILENAME
  sub(/.*\/limn\//, "limn/", name)
  print "/** @file " name
  opening = 1  # the file's comment comes next
  next
}
/^ *\/\// {
  column = match($0, /\/\//)
  text = substr($0, column + 2)
  gsub(/</, "\\<", text)  # no tags of HTML here
  indent = substr($0, 1, column - 1)
  if (opening) {
    print text
  } else {
    # Below a comment beside a declaration and in its column: the same comment goes on.
    print indent (column == beside ? "///<" : "///") text
  }
  next
}
opening {
  $0 = "*/ " $0
  opening = 0
}
# Without a comment of its own, a namespace's functions would have no page.
/^namespace limn \{/ { $0 = "/** All of limn. */ " $0 }
{
  beside = match($0, /[;,{}] +\/\/ /)
  if (beside) {
    beside += index(substr($0, beside), "//") - 1
    $0 = substr($0, 1, beside - 1) "///<" substr($0, beside + 2)
  }
  print
}
