/// Tables of rejected texts: a row for each, with the key at fault and words of the message.
#pragma once

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "variator_sim/errors.h"

namespace variator_sim::test {

struct Fault {
  std::string text;
  std::string path;
  std::vector<std::string> words;
};

/// How a case is shown when it fails.
inline void PrintTo(const Fault& fault, std::ostream* out) {
  *out << fault.path << " in\n" << fault.text;
}

/// The parts of `text` between `separator`.
inline std::vector<std::string> split(const std::string& text, const std::string& separator) {
  std::vector<std::string> parts;
  std::size_t begin = 0;
  for (std::size_t end; (end = text.find(separator, begin)) != std::string::npos;) {
    parts.push_back(text.substr(begin, end - begin));
    begin = end + separator.size();
  }
  parts.push_back(text.substr(begin));
  return parts;
}

/// Rows "TEXT => PATH: WORDS | WORDS". In a text " / " ends a line, and all of it stands behind
/// `prefix`. A line with two spaces at its head goes on with the row before; empty lines and those
/// that begin with # are passed over.
inline std::vector<Fault> readFaults(const std::string& prefix, const std::string& table) {
  std::vector<std::string> rows;
  std::istringstream lines(table);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    if (line.rfind("  ", 0) == 0) {
      rows.back() += line.substr(1);
    } else {
      rows.push_back(line);
    }
  }
  std::vector<Fault> faults;
  for (const std::string& row : rows) {
    const std::size_t arrow = row.find(" => ");
    const std::size_t colon = row.find(": ", arrow);
    const std::vector<std::string> text = split(row.substr(0, arrow), " / ");
    Fault fault{prefix + text[0], row.substr(arrow + 4, colon - arrow - 4),
                split(row.substr(colon + 2), " | ")};
    for (std::size_t n = 1; n < text.size(); ++n) fault.text += "\n" + text[n];
    faults.push_back(fault);
  }
  return faults;
}

/// The sections of test/faults/NAME.txt, head and rows: a line "@ HEAD" begins one.
inline std::vector<std::pair<std::string, std::string>> readFaultSections(const std::string& name) {
  std::ifstream file(std::string(VARIATOR_SIM_TEST_DIR) + "/faults/" + name + ".txt");
  std::vector<std::pair<std::string, std::string>> sections;
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("@ ", 0) == 0) {
      sections.emplace_back(line.substr(2), "");
    } else if (!sections.empty()) {
      sections.back().second += line + "\n";
    }
  }
  EXPECT_FALSE(sections.empty()) << name;
  return sections;
}

/// `read` refuses the text of a fault, by its key and words.
template <class Read>
void expectFault(const Fault& fault, const Read& read) {
  SCOPED_TRACE(testing::PrintToString(fault));
  try {
    read(fault.text);
    ADD_FAILURE() << "accepted";
  } catch (const SceneError& error) {
    const std::string message = error.what();
    EXPECT_EQ(error.keyPath(), fault.path) << message;
    EXPECT_EQ(message.rfind(fault.path + ": ", 0), 0U) << message;
    for (const std::string& word : fault.words) {
      EXPECT_NE(message.find(word), std::string::npos) << "no \"" << word << "\" in: " << message;
    }
  }
}

/// `action` is refused, by its key and words.
template <class Action>
void expectRefused(const std::string& path, const std::vector<std::string>& words,
                   const Action& action) {
  expectFault({"", path, words}, [&action](const std::string&) { action(); });
}

/// What `action` throws; "" if it does not.
template <class Action>
std::string messageOf(const Action& action) {
  try {
    action();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

/// `read` refuses each row of test/faults/NAME.txt behind the keys that the section's head gives.
template <class Read>
void expectFaultsOfElements(const std::string& name, const Read& read) {
  for (const auto& [head, rows] : readFaultSections(name)) {
    const std::string keys = head == "all keys" ? "" : head + ", ";
    for (const Fault& fault : readFaults(keys, rows)) expectFault(fault, read);
  }
}

template <class Read>
void expectFaults(const std::vector<Fault>& faults, const Read& read) {
  EXPECT_FALSE(faults.empty());
  for (const Fault& fault : faults) expectFault(fault, read);
}

}  // namespace variator_sim::test
