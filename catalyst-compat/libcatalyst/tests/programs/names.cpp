// Names that programs take from the headers, as a program of somebody else's uses them.
#include <catalyst.hpp>
#include <catalyst_conduit_blueprint.hpp>
#include <conduit_cpp_to_c.hpp>

#include <cstdio>
#include <string>
#include <type_traits>

#include "check.h"

static_assert(std::is_same<conduit_index32_t, conduit_int32>::value, "32 bits");
static_assert(std::is_same<conduit_index64_t, conduit_int64>::value, "64 bits");
static_assert(std::is_same<conduit_index_t, conduit_index64_t>::value, "an index has 64 bits");
static_assert(std::is_same<conduit_long_double, long double>::value, "long double");
static_assert(std::is_same<conduit_long_long, long long>::value, "long long");
static_assert(std::is_same<conduit_unsigned_long_long, unsigned long long>::value, "unsigned long long");
static_assert(std::is_same<CONDUIT_NATIVE_LONG_LONG, conduit_int64>::value, "long long by its width");
static_assert(std::is_same<CONDUIT_NATIVE_FLOAT, conduit_float32>::value, "float by its width");
static_assert(std::is_enum<conduit_datatype_type_id>::value, "the numbers of types");
static_assert(std::is_enum<conduit_endianness_type_id>::value, "the orders of bytes");
static_assert(CATALYST_VERSION_NUMBER >= CATALYST_VERSION_CHECK(2, 0, 0), "Catalyst 2");
// <climits> arrives.
static_assert(CHAR_BIT == 8 && INT_MAX == 2147483647, "limits");

// What a solver with a Conduit of its own hands over is its own matter; the names are there.
static_assert(std::is_same<decltype(conduit::c_node(static_cast<conduit::Node*>(nullptr))), conduit_node*>::value, "to C");
static_assert(
  std::is_same<decltype(conduit::cpp_node(static_cast<conduit_node*>(nullptr))), conduit::Node*>::value, "to C++");
static_assert(std::is_same<decltype(conduit::cpp_node_ref(static_cast<const conduit_node*>(nullptr))),
                const conduit::Node&>::value,
  "to C++");
static_assert(
  std::is_same<decltype(conduit::c_datatype(static_cast<conduit::DataType*>(nullptr))), conduit_datatype*>::value,
  "to C");

class CATALYST_DEPRECATED_EXPORT Old
{
};

CONDUIT_API int shown();
CONDUIT_BLUEPRINT_API int shown()
{
  return 1;
}

int main()
{
  conduit_cpp::Node node;
  node["number"].set(conduit_index64_t(7));
  const auto id = static_cast<conduit_datatype_type_id>(node["number"].dtype().type_id());
  CHECK(id == CONDUIT_INT64_ID);
  CHECK(std::string(CONDUIT_UINT64_NATIVE_NAME) == "unsigned long" && shown() == 1);
  conduit_cpp::Node info;
  CHECK(!conduit_cpp::Blueprint::verify("mesh", node, info));
  std::printf("names.cpp: ok\n");
  return 0;
}
