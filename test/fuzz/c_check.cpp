#include "fuzz/c_check.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <stdexcept>
#include <vector>

namespace variator_sim::fuzz {
namespace {

const std::set<std::string>& keywords() {
  static const std::set<std::string> all{"if", "for", "while", "switch", "return", "sizeof"};
  return all;
}

/// Returns the library functions that the templates call.
const std::set<std::string>& libraryFunctions() {
  static const std::set<std::string> all{
      // mathematics
      "acos", "asin", "atan", "atan2", "cos", "cosh", "exp", "expm1", "fabs", "fmax", "fmin",
      "frexp", "isfinite", "isinf", "isnan", "ldexp", "log", "pow", "sin", "sincos", "sinh", "sqrt",
      "tan", "tanh", "signbit", "floor",
      // memory and files (main.c)
      "memcpy", "memset", "memmove", "ferror", "fflush", "fgets", "fclose", "fopen", "fprintf",
      "fputc", "fputs", "strchr", "strcmp", "strcspn", "strspn", "strtod",
      // of the compiler, and pointers that are called
      "__attribute__", "always_inline", "vector_size", "aligned", "_Pragma", "__builtin_shuffle",
      "__builtin_shufflevector", "__builtin_memcpy", "__builtin_fabs", "__builtin_sqrt",
      "__builtin_fma", "__builtin_ia32_vfmaddpd256", "__builtin_ia32_vfmaddpd512_mask", "defined",
      "contract", "table", "table2"};
  return all;
}

bool isLetter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}
bool isDigit(char c) {
  return c >= '0' && c <= '9';
}

class Fault : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class Lexer {
 public:
  Lexer(const std::string& text, const std::string& name) : text_(text), name_(name) {}

  void check() {
    checkCharacters();
    while (at_ < text_.size()) readToken();
    if (!open_.empty()) fail("brackets are left open");
    for (const std::string& called : called_) {
      const bool is_own = called.compare(0, name_.size() + 1, name_ + "_") == 0;
      if (!is_own && defined_.count(called) == 0 && libraryFunctions().count(called) == 0) {
        throw Fault("a call of " + called);
      }
    }
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw Fault(what + ": " + text_.substr(at_ < 60 ? 0 : at_ - 60, 120));
  }
  char peek(std::size_t ahead = 0) const {
    return at_ + ahead < text_.size() ? text_[at_ + ahead] : '\0';
  }

  void checkCharacters() {
    for (at_ = 0; at_ < text_.size(); ++at_) {
      const char c = text_[at_];
      if (c != '\n' && (c < ' ' || c > '~')) fail("no character of C");
      if (c == '?' && peek(1) == '?') fail("a trigraph");
    }
    at_ = 0;
  }

  void readToken() {
    const char c = peek();
    const bool begins_line = at_ == 0 || text_[at_ - 1] == '\n';
    if (c == ' ' || c == '\n') {
      ++at_;
    } else if (c == '/' && peek(1) == '*') {
      readComment();
    } else if (c == '"' || c == '\'') {
      readQuoted(c);
    } else if (c == '#') {
      if (!begins_line) fail("a directive within a line");
      readDirective();
    } else if (isLetter(c)) {
      readWord();
    } else if (isDigit(c) || (c == '.' && isDigit(peek(1)))) {
      readNumber();
    } else {
      readPunctuation(c);
    }
  }

  void readComment() {
    const std::size_t end = text_.find("*/", at_ + 2);
    if (end == std::string::npos) fail("a comment without an end");
    if (text_.find("/*", at_ + 2) < end) fail("a comment in a comment");
    at_ = end + 2;
  }

  void readQuoted(char quote) {
    for (++at_; peek() != quote; ++at_) {
      if (peek() == '\0' || peek() == '\n') fail("a string without an end");
      if (peek() != '\\') continue;
      ++at_;
      if (std::string("nrt0\\\"'").find(peek()) == std::string::npos) fail("a strange escape");
    }
    ++at_;
  }

  void readDirective() {
    std::size_t end = text_.find('\n', at_);
    while (end != std::string::npos && text_[end - 1] == '\\') end = text_.find('\n', end + 1);
    const std::string line = text_.substr(at_, end - at_);
    static const std::set<std::string> headers{"float", "math", "stdio", "stdlib", "string"};
    const std::string macro = "#define ";
    const std::size_t bracket = line.find('(');
    if (line.rfind(macro, 0) == 0 && bracket != std::string::npos) {
      defined_.insert(line.substr(macro.size(), bracket - macro.size()));
    }
    bool is_known = line == "#endif" || line == "#else";
    for (const char* begin :
         {"#ifdef ", "#ifndef ", "#undef ", "#if ", "#elif ", "#define ", "#pragma "}) {
      is_known = is_known || line.rfind(begin, 0) == 0;
    }
    for (const std::string& header : headers) {
      is_known = is_known || line == "#include <" + header + ".h>";
    }
    if (!is_known && line != "#include \"" + name_ + ".h\"") fail("a strange directive");
    at_ += line.size();
  }

  void readWord() {
    const std::size_t begin = at_;
    while (isLetter(peek()) || isDigit(peek())) ++at_;
    const std::string word = text_.substr(begin, at_ - begin);
    if (peek() != '(' || keywords().count(word) > 0) return;
    called_.insert(word);
    // A function's head ends its line, and its body follows; nothing is called outside of bodies.
    if (open_.empty()) defining_ = word;
  }

  void readNumber() {
    while (isLetter(peek()) || isDigit(peek()) || peek() == '.' ||
           ((peek() == '+' || peek() == '-') && (text_[at_ - 1] == 'e' || text_[at_ - 1] == 'E'))) {
      ++at_;
    }
  }

  void readPunctuation(char c) {
    static const std::string allowed = "+-*/%<>=!&|^~?:;,.()[]{}";
    if (allowed.find(c) == std::string::npos) fail("no token of C");
    if (c == '/' && peek(1) == '/') fail("a comment of another kind");
    if (c == ';' && open_.empty()) defining_.clear();
    if (c == '{' && open_.empty() && !defining_.empty()) defined_.insert(defining_);
    if (c == '(' || c == '[' || c == '{') open_ += c;
    if (c == ')' || c == ']' || c == '}') {
      const char pair = c == ')' ? '(' : c == ']' ? '[' : '{';
      if (open_.empty() || open_.back() != pair) fail("a bracket without its pair");
      open_.pop_back();
    }
    ++at_;
  }

  const std::string& text_;
  const std::string& name_;
  std::size_t at_ = 0;
  std::string open_;      ///< brackets
  std::string defining_;  ///< the function whose head was read
  std::set<std::string> called_;
  std::set<std::string> defined_;
};

/// A temporary folder of this process.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "fuzz_c_XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) std::abort();
    path_ = name;
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// The exit status of `words`, which write into `log`; -1 where there is no such program.
int call(std::vector<std::string> words, const std::string& log) {
  std::vector<char*> pointers;
  pointers.reserve(words.size() + 1);
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, log.c_str(),
                                     O_WRONLY | O_CREAT | O_TRUNC, 0600);
  pid_t child = 0;
  const int error =
      ::posix_spawnp(&child, pointers.front(), &actions, nullptr, pointers.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return -1;
  int status = 0;
  while (::waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) return -1;
  }
  return WIFEXITED(status) && WEXITSTATUS(status) != 127 ? WEXITSTATUS(status) : -1;
}

}  // namespace

std::string findFaultOfC(const std::string& text, const std::string& name) {
  try {
    Lexer(text, name).check();
  } catch (const Fault& fault) {
    return fault.what();
  }
  return "";
}

std::string compileC(const std::string& text, const std::vector<std::string>& options,
                     const std::string& name, const std::string& header) {
  static const Folder folder;
  const std::string log = folder.path() / "log";
  std::ofstream(folder.path() / (name + ".h")) << header;
  std::ofstream(folder.path() / "text.c") << text;
  std::vector<std::string> words{"cc", "-fsyntax-only", "-Wall", "-Wextra", "-Werror"};
  words.insert(words.end(), options.begin(), options.end());
  words.push_back(folder.path() / "text.c");
  const int status = call(words, log);
  std::error_code ignored;
  std::filesystem::remove(folder.path() / (name + ".h"), ignored);
  if (status <= 0) return "";
  std::ifstream stream(log);
  return "cc: " + std::string(std::istreambuf_iterator<char>(stream), {});
}

}  // namespace variator_sim::fuzz
