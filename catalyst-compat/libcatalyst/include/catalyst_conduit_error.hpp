// The exception of conduit_cpp.
#ifndef catalyst_conduit_error_hpp
#define catalyst_conduit_error_hpp

#include <exception>
#include <iostream>
#include <sstream>
#include <string>

namespace conduit_cpp
{

// What went wrong, and the file and line that noticed it.
class Error : public std::exception
{
public:
  Error() = default;
  Error(const std::string& message, const std::string& file, int line)
    : Message(message)
    , File(file)
    , Line(line)
  {
    this->compose();
  }

  const char* what() const noexcept override { return this->What.c_str(); }
  std::string message() const { return this->Message; }
  std::string file() const { return this->File; }
  int line() const { return this->Line; }

  void print(std::ostream& stream) const { stream << this->What; }
  void print() const { this->print(std::cout); }

private:
  void compose()
  {
    std::ostringstream text;
    text << this->Message << " (" << this->File << ", line " << this->Line << ")";
    this->What = text.str();
  }

  std::string Message;
  std::string File;
  int Line = 0;
  std::string What;
};

}

#endif
