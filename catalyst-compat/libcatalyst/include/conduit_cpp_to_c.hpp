// The way between a Conduit of C++ and nodes of the C interface. What is declared here is of that Conduit's own library: this
// one exports C alone, and conduit_cpp::c_node and conduit_cpp::cpp_node of catalyst_conduit.hpp are its way.
#ifndef conduit_cpp_to_c_hpp
#define conduit_cpp_to_c_hpp

#if defined(__has_include)
#if __has_include("conduit.hpp")
#include "conduit.hpp"
#endif
#endif

#include "conduit.h"

namespace conduit
{

class Node;
class DataType;

CONDUIT_API Node* cpp_node(conduit_node* node);
CONDUIT_API const Node* cpp_node(const conduit_node* node);
CONDUIT_API Node& cpp_node_ref(conduit_node* node);
CONDUIT_API const Node& cpp_node_ref(const conduit_node* node);
CONDUIT_API conduit_node* c_node(Node* node);
CONDUIT_API const conduit_node* c_node(const Node* node);

CONDUIT_API DataType* cpp_datatype(conduit_datatype* datatype);
CONDUIT_API const DataType* cpp_datatype(const conduit_datatype* datatype);
CONDUIT_API DataType& cpp_datatype_ref(conduit_datatype* datatype);
CONDUIT_API const DataType& cpp_datatype_ref(const conduit_datatype* datatype);
CONDUIT_API conduit_datatype* c_datatype(DataType* datatype);
CONDUIT_API const conduit_datatype* c_datatype(const DataType* datatype);

}

#endif
