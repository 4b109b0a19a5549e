// Blueprint for nodes as objects.
#ifndef catalyst_conduit_blueprint_hpp
#define catalyst_conduit_blueprint_hpp

#include <string>

#include "catalyst_conduit.hpp"
#include "catalyst_conduit_error.hpp"
#include "conduit_blueprint.h"

namespace conduit_cpp
{

class Blueprint
{
public:
  static int verify(const std::string& protocol, const Node& node, Node& info)
  {
    return conduit_blueprint_verify(protocol.c_str(), c_node(&node), c_node(&info));
  }

  static void about(Node& target) { conduit_blueprint_about(c_node(&target)); }
};

class BlueprintMcArray
{
public:
  static int verify(const Node& node, Node& info)
  {
    return conduit_blueprint_mcarray_verify(c_node(&node), c_node(&info));
  }

  static int verify_sub_protocol(const std::string& protocol, const Node& node, Node& info)
  {
    return conduit_blueprint_mcarray_verify_sub_protocol(protocol.c_str(), c_node(&node), c_node(&info));
  }

  static bool is_interleaved(const Node& node)
  {
    return conduit_blueprint_mcarray_is_interleaved(c_node(&node)) != 0;
  }

  static int to_interleaved(const Node& node, Node& target)
  {
    return conduit_blueprint_mcarray_to_interleaved(c_node(&node), c_node(&target));
  }

  static int to_contiguous(const Node& node, Node& target)
  {
    return conduit_blueprint_mcarray_to_contiguous(c_node(&node), c_node(&target));
  }
};

class BlueprintMesh
{
public:
  static int verify(const Node& node, Node& info)
  {
    return conduit_blueprint_mesh_verify(c_node(&node), c_node(&info));
  }

  static int verify_sub_protocol(const std::string& protocol, const Node& node, Node& info)
  {
    return conduit_blueprint_mesh_verify_sub_protocol(protocol.c_str(), c_node(&node), c_node(&info));
  }

  static void mesh_generate_index(
    const Node& mesh, const std::string& path, conduit_index_t domains, Node& index)
  {
    conduit_blueprint_mesh_generate_index(c_node(&mesh), path.c_str(), domains, c_node(&index));
  }

  static void generate_index(const Node& mesh, const std::string& path, conduit_index_t domains, Node& index)
  {
    mesh_generate_index(mesh, path, domains, index);
  }

  static void partition(const Node& mesh, const Node& options, Node& output)
  {
    conduit_blueprint_mesh_partition(c_node(&mesh), c_node(&options), c_node(&output));
  }

  static void flatten(const Node& mesh, const Node& options, Node& output)
  {
    conduit_blueprint_mesh_flatten(c_node(&mesh), c_node(&options), c_node(&output));
  }
};

class BlueprintTable
{
public:
  static int verify(const Node& node, Node& info)
  {
    return conduit_blueprint_table_verify(c_node(&node), c_node(&info));
  }

  static int verify_sub_protocol(const std::string& protocol, const Node& node, Node& info)
  {
    return conduit_blueprint_table_verify_sub_protocol(protocol.c_str(), c_node(&node), c_node(&info));
  }
};

}

#endif
