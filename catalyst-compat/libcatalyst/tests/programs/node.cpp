// Nodes as objects: what is copied, what refers, what is thrown.
#include <catalyst.hpp>
#include <catalyst_conduit_blueprint.hpp>
#include <catalyst_impl.h>
#include <catalyst_stub.h>

#include <stdexcept>
#include <type_traits>
#include <utility>

#include "check.h"

using conduit_cpp::c_node;
using conduit_cpp::cpp_node;
using conduit_cpp::Node;

static_assert(std::is_same<decltype(catalyst_results), enum catalyst_status(conduit_node*)>::value, "catalyst_results");
static_assert(std::is_same<decltype(catalyst_impl::initialize), decltype(&catalyst_initialize)>::value, "initialize");
static_assert(std::is_same<decltype(catalyst_stub_execute), decltype(catalyst_execute)>::value, "stub");
static_assert(std::is_same<decltype(conduit_node_set_path_int64_ptr),
                void(conduit_node*, const char*, conduit_int64*, conduit_index_t)>::value,
  "family");

template <typename Call>
static std::string thrown(Call call)
{
  try
  {
    call();
  }
  catch (const conduit_cpp::Error& error)
  {
    return error.message();
  }
  return "";
}
#define CHECK_THROWS(call, text) CHECK(thrown([&] { call; }).find(text) != std::string::npos)

template <typename T>
static void types()
{
  Node node;
  T array[4] = { 1, 2, 3, 4 };
  std::vector<T> values(array, array + 4);
  node["value"] = T(5);
  node["copied"] = values;
  node["set"].set(values);
  node["pointer"].set(array, 2, 2 * sizeof(T));
  node["lent"].set_external(array, 2, 0, 2 * sizeof(T));
  node["vector"].set_external(values);
  node.set_path("path/value", T(6));
  node.set_path("path/vector", values);
  node.set_path_external("path/lent", array, 4);
  CHECK(node["value"].to_int32() == 5 && node["value"].to_double() == 5 && node["value"].to_unsigned_char() == 5);
  CHECK(static_cast<T*>(node["copied"].data_ptr())[3] == 4 && node["copied"].data_ptr() != values.data());
  CHECK(node["set"].number_of_elements() == 4 && node["pointer"].to_int64() == 3);
  CHECK(node["lent"].element_ptr(1) == array + 2 && node["vector"].data_ptr() == values.data());
  CHECK(node["path/value"].to_uint16() == 6 && node["path/lent"].data_ptr() == array);
  node["lent"] = T(9);
  CHECK(array[0] == 9);
}

int main()
{
  types<conduit_int8>();
  types<conduit_int16>();
  types<conduit_int32>();
  types<conduit_int64>();
  types<conduit_uint8>();
  types<conduit_uint16>();
  types<conduit_uint32>();
  types<conduit_uint64>();
  types<conduit_float32>();
  types<conduit_float64>();

  Node node;
  node["a"] = 5;
  node["text"] = "one";
  node["string"].set(std::string("two"));
  node["empty"].set("");
  CHECK(node["text"].as_string() == "one" && std::string(node["string"].as_char8_str()) == "two");
  CHECK(node["empty"].as_string().empty() && node["text"].to_int() == 0);
  node["number"] = "42";
  CHECK(node["number"].to_int8() == 42 && node["number"].to_double() == 42.0);
  node["letter"] = 'x';
  CHECK(node["letter"].as_char() == 'x' && node["letter"].dtype().is_int8());
  node["long"] = 1LL << 40;
  CHECK(node["long"].as_int64() == 1LL << 40);

  // Places refer, variables own, copies copy.
  {
    Node place = node["a"];
    place = 6;
    Node again = node["a"];
    CHECK(c_node(&place) == c_node(&again));
  }
  CHECK(node["a"].as_int() == 6);
  Node copy(node);
  copy["a"] = 7;
  CHECK(node["a"].as_int() == 6 && copy.number_of_children() == node.number_of_children());
  Node variable;
  variable = node["a"];
  CHECK(c_node(&variable) != nullptr && variable.data_ptr() == node["a"].data_ptr());
  node["moved"] = std::move(copy);
  CHECK(node["moved/a"].as_int() == 7);
  Node borrowed = cpp_node(c_node(&node));
  CHECK(borrowed["a"].data_ptr() == node["a"].data_ptr());

  // What cpp_node gives is the node itself, also where there is nothing in it yet, and leaves it to its owner.
  conduit_node* bare = conduit_node_create();
  {
    Node wrapped = cpp_node(bare);
    CHECK(c_node(&wrapped) == bare);
    wrapped["made/here"] = 3;
    Node again;
    again = cpp_node(conduit_node_fetch(bare, "made"));
    again["there"] = 4;
  }
  CHECK(conduit_node_fetch_path_as_int(bare, "made/here") == 3 && conduit_node_fetch_path_as_int(bare, "made/there") == 4);
  conduit_node_destroy(bare);

  // What is lent may be constant.
  const std::vector<double> constants = { 1, 2 };
  node["constants"].set_external(constants);
  node.set_path_external("constant", &constants[1], 1);
  CHECK(node["constants"].as_double_ptr() == constants.data() && node["constant"].as_double() == 2);
  CHECK(node["constants"].dtype().type_id() == CONDUIT_FLOAT64_ID);

  // Printing goes where std::cout goes.
  {
    Node printed;
    printed["a"] = 10;
    printed["b/c"] = 30.0;
    std::ostringstream told;
    std::streambuf* usual = std::cout.rdbuf(told.rdbuf());
    printed.print();
    printed["a"].print_detailed();
    std::cout.rdbuf(usual);
    CHECK(told.str() == "\na: 10\nb: \n  c: 30.0\n\n"
                        "{\"dtype\":\"int32\",\"number_of_elements\": 1,\"offset\": 0,\"stride\": 4,"
                        "\"element_bytes\": 4,\"endianness\": \"little\", \"value\": 10}\n");
  }

  Node list = node["list"];
  list.append().set(1.5);
  list.append() = 2.5f;
  CHECK(list[1].as_float() == 2.5f && list.child(0).path() == "list/[0]" && list.name() == "list");
  const Node constant(node);
  CHECK(constant["list"][0].as_double() == 1.5 && constant["a"].as_int_ptr()[0] == 6);

  CHECK_THROWS(node["a"].as_double(), "'a' holds int32, not float64");
  CHECK_THROWS(node["a"].as_string(), "not char8_str");
  CHECK_THROWS(node[""], "empty path");
  CHECK_THROWS(node["../x"], "above the root");
  CHECK_THROWS(node.remove("nothing"), "'nothing'");
  CHECK_THROWS(node.remove(99), "99");
  CHECK_THROWS(node.child(99), "99");
  CHECK_THROWS(constant["nothing"], "'nothing'");
  CHECK_THROWS(constant[""], "''");
  CHECK_THROWS(constant["../a"], "'../a'");
  CHECK_THROWS(node.rename_child("a", "text"), "already");
  CHECK_THROWS(node.parse("{", "json"), "line 1");
  // Whoever calls the C interface from C++ gets an exception of C++.
  bool standard = false;
  try
  {
    conduit_node_as_double(c_node(&variable));
  }
  catch (const std::exception& error)
  {
    standard = std::string(error.what()).find("not float64") != std::string::npos;
  }
  CHECK(standard);

  Node info;
  CHECK(!node.diff(node, info) && node.compatible(node));
  Node parsed;
  parsed.parse(node.to_json(), "json");
  CHECK(parsed["moved/text"].as_string() == "one");
  CHECK(node["a"].dtype().id() == conduit_cpp::DataType::Id::int32 && node.dtype().is_object());
  CHECK(node["a"].dtype().name() == "int32");

  Node mesh;
  mesh["coordsets/c/type"] = "uniform";
  mesh["coordsets/c/dims/i"] = 3;
  mesh["coordsets/c/dims/j"] = 3;
  mesh["topologies/t/type"] = "uniform";
  mesh["topologies/t/coordset"] = "c";
  CHECK(conduit_cpp::BlueprintMesh::verify(mesh, info) == 1);
  mesh["topologies/t/coordset"] = "d";
  CHECK(conduit_cpp::Blueprint::verify("mesh", mesh, info) == 0);
  CHECK(info["valid"].as_string() == "false");

  // An exception of an implementation passes through Catalyst.
  Node load;
  load["catalyst_load/implementation"] = "echo";
  if (catalyst_initialize(c_node(&load)) == catalyst_status_ok)
  {
    Node step;
    step["throw"] = 1;
    bool passed = false;
    try
    {
      catalyst_execute(c_node(&step));
    }
    catch (const std::runtime_error& error)
    {
      passed = std::string(error.what()) == "echo throws";
    }
    CHECK(passed);
    step.remove("throw");
    step["catalyst/state/timestep"] = 1;
    CHECK(catalyst_execute(c_node(&step)) == catalyst_status_ok);
  }
  std::cout << "node.cpp: ok" << std::endl;
  return 0;
}
