// Conduit's nodes as objects, over the C interface alone. What goes wrong is thrown as conduit_cpp::Error.
#ifndef catalyst_conduit_hpp
#define catalyst_conduit_hpp

#include <climits>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <iostream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "catalyst_conduit_datatype.hpp"
#include "catalyst_conduit_error.hpp"
#include "catalyst_conduit_families.hpp"
#include "conduit.h"

#define CATALYST_CONDUIT_ERROR(message) throw ::conduit_cpp::Error((message), std::string(__FILE__), __LINE__);

// Runs what may throw, and turns what the library throws into an Error with its message.
#define CATALYST_CONDUIT_WRAP_EXCEP(...)                                                                     \
  try                                                                                                        \
  {                                                                                                          \
    __VA_ARGS__;                                                                                             \
  }                                                                                                          \
  catch (const ::conduit_cpp::Error&)                                                                        \
  {                                                                                                          \
    throw;                                                                                                   \
  }                                                                                                          \
  catch (const std::exception& thrown)                                                                       \
  {                                                                                                          \
    CATALYST_CONDUIT_ERROR(thrown.what())                                                                    \
  }                                                                                                          \
  catch (...)                                                                                                \
  {                                                                                                          \
    CATALYST_CONDUIT_ERROR("Conduit threw something that is no std::exception")                              \
  }

namespace conduit_cpp
{

// A node, or a place in the tree of another: what operator[], child, append and cpp_node give refers to the tree that it is from
// and leaves that to its owner. Copying copies the data; moving does not.
class Node
{
public:
  Node()
    : Handle(conduit_node_create())
    , Owns(true)
  {
  }
  Node(const Node& other)
    : Node()
  {
    this->set(other);
  }
  Node(Node&& other) noexcept
    : Handle(other.Handle)
    , Owns(other.Owns)
  {
    other.Handle = nullptr;
  }
  // Nothing is written to memory that is given back: VTK 9.2 reads the handle of nodes that are gone out of scope.
  ~Node() { this->destroy(); }

  Node& operator=(const Node& other)
  {
    if (this != &other)
    {
      this->set(other);
    }
    return *this;
  }
  // A variable takes over what it is given; a place in a tree gets a copy.
  Node& operator=(Node&& other) &
  {
    if (this != &other)
    {
      this->release();
      this->Handle = other.Handle;
      this->Owns = other.Owns;
      other.Handle = nullptr;
    }
    return *this;
  }
  Node& operator=(Node&& other) &&
  {
    if (this != &other)
    {
      this->set(other);
    }
    return *this;
  }

  friend conduit_node* c_node(const Node* node);
  friend Node cpp_node(conduit_node* node);

  void reset() { conduit_node_reset(this->Handle); }
  void move(Node& other) { CATALYST_CONDUIT_WRAP_EXCEP(conduit_node_move(this->Handle, other.Handle)) }
  void swap(Node& other) { CATALYST_CONDUIT_WRAP_EXCEP(conduit_node_swap(this->Handle, other.Handle)) }

  // ---- Setting to a tree or a text.
  void set_node(const Node& data) { conduit_node_set_node(this->Handle, data.Handle); }
  void set(const Node& data) { this->set_node(data); }
  void set_path_node(const std::string& path, const Node& data)
  {
    conduit_node_set_path_node(this->Handle, path.c_str(), data.Handle);
  }
  void set_path(const std::string& path, const Node& data) { this->set_path_node(path, data); }
  void set_external_node(Node& data) { conduit_node_set_external_node(this->Handle, data.Handle); }
  void set_external(Node& data) { this->set_external_node(data); }
  void set_path_external_node(const std::string& path, Node& data)
  {
    conduit_node_set_path_external_node(this->Handle, path.c_str(), data.Handle);
  }
  void set_path_external(const std::string& path, Node& data) { this->set_path_external_node(path, data); }

  void set_string(const std::string& data) { conduit_node_set_char8_str(this->Handle, data.c_str()); }
  void set(const std::string& data) { this->set_string(data); }
  void set(const char* data) { this->set_char8_str(data); }
  void set_char8_str(const char* data) { conduit_node_set_char8_str(this->Handle, data); }
  void set_path_string(const std::string& path, const std::string& data)
  {
    this->set_path_char8_str(path, data.c_str());
  }
  void set_path(const std::string& path, const std::string& data) { this->set_path_string(path, data); }
  void set_path(const std::string& path, const char* data) { this->set_path_char8_str(path, data); }
  void set_path_char8_str(const std::string& path, const char* data)
  {
    conduit_node_set_path_char8_str(this->Handle, path.c_str(), data);
  }
  void set_external_char8_str(char* data) { conduit_node_set_external_char8_str(this->Handle, data); }
  void set_path_external_char8_str(const std::string& path, char* data)
  {
    conduit_node_set_path_external_char8_str(this->Handle, path.c_str(), data);
  }
  Node& operator=(const std::string& data)
  {
    this->set(data);
    return *this;
  }
  Node& operator=(const char* data)
  {
    this->set_char8_str(data);
    return *this;
  }

  // ---- Setting to numbers and arrays of them, copied or borrowed.
  CATALYST_CONDUIT_NAMED(int8, conduit_int8)
  CATALYST_CONDUIT_NAMED(int16, conduit_int16)
  CATALYST_CONDUIT_NAMED(int32, conduit_int32)
  CATALYST_CONDUIT_NAMED(int64, conduit_int64)
  CATALYST_CONDUIT_NAMED(uint8, conduit_uint8)
  CATALYST_CONDUIT_NAMED(uint16, conduit_uint16)
  CATALYST_CONDUIT_NAMED(uint32, conduit_uint32)
  CATALYST_CONDUIT_NAMED(uint64, conduit_uint64)
  CATALYST_CONDUIT_NAMED(float32, conduit_float32)
  CATALYST_CONDUIT_NAMED(float64, conduit_float64)
  CATALYST_CONDUIT_NAMED(char, char)
  CATALYST_CONDUIT_NAMED(short, short)
  CATALYST_CONDUIT_NAMED(int, int)
  CATALYST_CONDUIT_NAMED(long, long)
  CATALYST_CONDUIT_NAMED(signed_char, signed char)
  CATALYST_CONDUIT_NAMED(signed_short, signed short)
  CATALYST_CONDUIT_NAMED(signed_int, signed int)
  CATALYST_CONDUIT_NAMED(signed_long, signed long)
  CATALYST_CONDUIT_NAMED(unsigned_char, unsigned char)
  CATALYST_CONDUIT_NAMED(unsigned_short, unsigned short)
  CATALYST_CONDUIT_NAMED(unsigned_int, unsigned int)
  CATALYST_CONDUIT_NAMED(unsigned_long, unsigned long)
  CATALYST_CONDUIT_NAMED(float, float)
  CATALYST_CONDUIT_NAMED(double, double)

  CATALYST_CONDUIT_TYPED(int8, conduit_int8)
  CATALYST_CONDUIT_TYPED(int16, conduit_int16)
  CATALYST_CONDUIT_TYPED(int32, conduit_int32)
  CATALYST_CONDUIT_TYPED(int64, conduit_int64)
  CATALYST_CONDUIT_TYPED(uint8, conduit_uint8)
  CATALYST_CONDUIT_TYPED(uint16, conduit_uint16)
  CATALYST_CONDUIT_TYPED(uint32, conduit_uint32)
  CATALYST_CONDUIT_TYPED(uint64, conduit_uint64)
  CATALYST_CONDUIT_TYPED(float32, conduit_float32)
  CATALYST_CONDUIT_TYPED(float64, conduit_float64)
#undef CATALYST_CONDUIT_NAMED
#undef CATALYST_CONDUIT_TYPED
#undef CATALYST_CONDUIT_LAYOUT
#undef CATALYST_CONDUIT_PASS

  // `char` is none of the types by width, and a pointer to it is a text.
  void set(const char data) { this->set_char(data); }
  void set(const std::vector<char>& data) { this->set_char_vector(data); }
  void set_path(const std::string& path, const char data) { this->set_path_char(path, data); }
  void set_path(const std::string& path, const std::vector<char>& data) { this->set_path_char_vector(path, data); }
  void set_external(const std::vector<char>& data) { this->set_external_char_vector(data); }
  void set_path_external(const std::string& path, const std::vector<char>& data)
  {
    this->set_path_external_char_vector(path, data);
  }
  Node& operator=(const char data)
  {
    this->set(data);
    return *this;
  }
  Node& operator=(const std::vector<char>& data)
  {
    this->set(data);
    return *this;
  }
  // `long long` is as wide as a type by width, but another type to C++.
  void set(const long long data) { this->set_int64(static_cast<conduit_int64>(data)); }
  void set(const unsigned long long data) { this->set_uint64(static_cast<conduit_uint64>(data)); }
  Node& operator=(const long long data)
  {
    this->set(data);
    return *this;
  }
  Node& operator=(const unsigned long long data)
  {
    this->set(data);
    return *this;
  }

  conduit_index_t to_index_t() const { return this->converted<conduit_index_t>(); }

  // ---- Texts.
  char* as_char8_str() { CATALYST_CONDUIT_WRAP_EXCEP(return conduit_node_as_char8_str(this->Handle)) }
  const char* as_char8_str() const
  {
    CATALYST_CONDUIT_WRAP_EXCEP(return conduit_node_as_char8_str(this->Handle))
  }
  std::string as_string() const
  {
    CATALYST_CONDUIT_WRAP_EXCEP(const char* text = conduit_node_as_char8_str(this->Handle);
                                return std::string(text ? text : ""))
  }

  // ---- Addresses.
  void* data_ptr() { return conduit_node_data_ptr(this->Handle); }
  const void* data_ptr() const { return conduit_node_data_ptr(this->Handle); }
  void* element_ptr(conduit_index_t index) { return conduit_node_element_ptr(this->Handle, index); }
  const void* element_ptr(conduit_index_t index) const { return conduit_node_element_ptr(this->Handle, index); }

  // ---- Children.
  Node operator[](const std::string& path) { return this->fetch(path); }
  const Node operator[](const std::string& path) const
  {
    if (!this->has_path(path))
    {
      CATALYST_CONDUIT_ERROR("'" + path + "' is not there")
    }
    return this->fetch_existing(path);
  }
  Node operator[](conduit_index_t index) { return this->child(index); }
  const Node operator[](conduit_index_t index) const { return this->child(index); }
  Node fetch(const std::string& path)
  {
    CATALYST_CONDUIT_WRAP_EXCEP(return Node(conduit_node_fetch(this->Handle, path.c_str())))
  }
  Node fetch_existing(const std::string& path) const
  {
    CATALYST_CONDUIT_WRAP_EXCEP(return Node(conduit_node_fetch_existing(this->Handle, path.c_str())))
  }
  Node add_child(const std::string& name)
  {
    CATALYST_CONDUIT_WRAP_EXCEP(return Node(conduit_node_add_child(this->Handle, name.c_str())))
  }
  Node child(conduit_index_t index)
  {
    CATALYST_CONDUIT_WRAP_EXCEP(return Node(conduit_node_child(this->Handle, index)))
  }
  const Node child(conduit_index_t index) const
  {
    CATALYST_CONDUIT_WRAP_EXCEP(return Node(conduit_node_child(this->Handle, index)))
  }
  Node child(const std::string& name) const
  {
    CATALYST_CONDUIT_WRAP_EXCEP(return Node(conduit_node_child_by_name(this->Handle, name.c_str())))
  }
  Node append() { CATALYST_CONDUIT_WRAP_EXCEP(return Node(conduit_node_append(this->Handle))) }
  void remove(conduit_index_t index)
  {
    CATALYST_CONDUIT_WRAP_EXCEP(conduit_node_remove_child(this->Handle, index))
  }
  void remove(const std::string& path)
  {
    CATALYST_CONDUIT_WRAP_EXCEP(conduit_node_remove_path(this->Handle, path.c_str()))
  }
  void remove_child(const std::string& name)
  {
    CATALYST_CONDUIT_WRAP_EXCEP(conduit_node_remove_child_by_name(this->Handle, name.c_str()))
  }
  void rename_child(const std::string& current_name, const std::string& new_name)
  {
    CATALYST_CONDUIT_WRAP_EXCEP(
      conduit_node_rename_child(this->Handle, current_name.c_str(), new_name.c_str()))
  }
  conduit_index_t number_of_children() const { return conduit_node_number_of_children(this->Handle); }
  conduit_index_t number_of_elements() const { return conduit_node_number_of_elements(this->Handle); }
  bool has_child(const std::string& name) const { return conduit_node_has_child(this->Handle, name.c_str()) != 0; }
  bool has_path(const std::string& path) const { return conduit_node_has_path(this->Handle, path.c_str()) != 0; }
  bool is_root() const { return conduit_node_is_root(this->Handle) != 0; }
  std::string name() const { return taken(conduit_node_name(this->Handle)); }
  std::string path() const { return taken(conduit_node_path(this->Handle)); }

  // ---- What is known of it.
  DataType dtype() const { return DataType(this->c_dtype()); }
  const conduit_datatype* c_dtype() const { return conduit_node_dtype(this->Handle); }
  bool is_data_external() const { return conduit_node_is_data_external(this->Handle) != 0; }
  bool is_compact() const { return conduit_node_is_compact(this->Handle) != 0; }
  bool is_contiguous() const { return conduit_node_is_contiguous(this->Handle) != 0; }
  bool contiguous_with(const Node& other) const
  {
    return conduit_node_contiguous_with_node(this->Handle, other.Handle) != 0;
  }
  bool contiguous_with(void* address) const
  {
    return conduit_node_contiguous_with_address(this->Handle, address) != 0;
  }
  conduit_index_t total_strided_bytes() const { return conduit_node_total_strided_bytes(this->Handle); }
  conduit_index_t total_bytes_compact() const { return conduit_node_total_bytes_compact(this->Handle); }
  conduit_index_t total_bytes_allocated() const { return conduit_node_total_bytes_allocated(this->Handle); }
  bool compatible(const Node& other) const { return conduit_node_compatible(this->Handle, other.Handle) != 0; }
  bool diff(const Node& other, Node& info, const conduit_float64 epsilon = 1e-12) const
  {
    CATALYST_CONDUIT_WRAP_EXCEP(return conduit_node_diff(this->Handle, other.Handle, info.Handle, epsilon) != 0)
  }
  bool diff_compatible(const Node& other, Node& info, const conduit_float64 epsilon = 1e-12) const
  {
    CATALYST_CONDUIT_WRAP_EXCEP(
      return conduit_node_diff_compatible(this->Handle, other.Handle, info.Handle, epsilon) != 0)
  }
  void info(Node& result) const { conduit_node_info(this->Handle, result.Handle); }
  Node info() const
  {
    Node result;
    this->info(result);
    return result;
  }

  // ---- Whole trees.
  void update(const Node& other) { CATALYST_CONDUIT_WRAP_EXCEP(conduit_node_update(this->Handle, other.Handle)) }
  void update_compatible(const Node& other)
  {
    CATALYST_CONDUIT_WRAP_EXCEP(conduit_node_update_compatible(this->Handle, other.Handle))
  }
  void update_external(Node& other)
  {
    CATALYST_CONDUIT_WRAP_EXCEP(conduit_node_update_external(this->Handle, other.Handle))
  }
  void compact_to(Node& result) const
  {
    CATALYST_CONDUIT_WRAP_EXCEP(conduit_node_compact_to(this->Handle, result.Handle))
  }

  // ---- Text and files.
  // To std::cout, wherever that leads.
  void print() const { std::cout << this->to_summary_string() << std::endl; }
  void print_detailed() const
  {
    Node options;
    options.set_path("protocol", "conduit_json");
    std::cout << taken(conduit_node_to_json_with_options(this->Handle, options.Handle)) << std::endl;
  }
  std::string to_json() const { return taken(conduit_node_to_json(this->Handle)); }
  std::string to_yaml() const { return taken(conduit_node_to_yaml(this->Handle)); }
  std::string to_string() const { return taken(conduit_node_to_string(this->Handle)); }
  std::string to_summary_string() const { return taken(conduit_node_to_summary_string(this->Handle)); }
  void parse(const std::string& text, const std::string& protocol = "")
  {
    CATALYST_CONDUIT_WRAP_EXCEP(conduit_node_parse(this->Handle, text.c_str(), protocol.c_str()))
  }
  void save(const std::string& path, const std::string& protocol = "") const
  {
    CATALYST_CONDUIT_WRAP_EXCEP(conduit_node_save(this->Handle, path.c_str(), protocol.c_str()))
  }
  void load(const std::string& path, const std::string& protocol = "")
  {
    CATALYST_CONDUIT_WRAP_EXCEP(conduit_node_load(this->Handle, path.c_str(), protocol.c_str()))
  }

private:
  explicit Node(conduit_node* handle)
    : Handle(handle)
    , Owns(false)
  {
  }

  void destroy()
  {
    if (this->Handle && this->Owns)
    {
      conduit_node_destroy(this->Handle);
    }
  }

  void release()
  {
    this->destroy();
    this->Handle = nullptr;
  }

  // An address that is not null, also where there are no elements.
  template <typename T>
  static const T* some(const std::vector<T>& data)
  {
    static const T nothing = T();
    return data.empty() ? &nothing : data.data();
  }

  // A text that the library has handed over.
  static std::string taken(char* text)
  {
    if (!text)
    {
      CATALYST_CONDUIT_ERROR("Conduit has no text to give")
    }
    std::string copy(text);
    std::free(text);
    return copy;
  }

  // The first number as another type, or the number that a text spells; 0 where there is none.
  template <typename T>
  T converted() const
  {
    switch (conduit_datatype_id(this->c_dtype()))
    {
      case CONDUIT_INT8_ID:
        return static_cast<T>(this->as_int8());
      case CONDUIT_INT16_ID:
        return static_cast<T>(this->as_int16());
      case CONDUIT_INT32_ID:
        return static_cast<T>(this->as_int32());
      case CONDUIT_INT64_ID:
        return static_cast<T>(this->as_int64());
      case CONDUIT_UINT8_ID:
        return static_cast<T>(this->as_uint8());
      case CONDUIT_UINT16_ID:
        return static_cast<T>(this->as_uint16());
      case CONDUIT_UINT32_ID:
        return static_cast<T>(this->as_uint32());
      case CONDUIT_UINT64_ID:
        return static_cast<T>(this->as_uint64());
      case CONDUIT_FLOAT32_ID:
        return static_cast<T>(this->as_float32());
      case CONDUIT_FLOAT64_ID:
        return static_cast<T>(this->as_float64());
      case CONDUIT_CHAR8_STR_ID:
        return spelt<T>(this->as_string());
      default:
        return T(0);
    }
  }

  // A type of one byte would be read as a letter, so numbers are read as wider ones.
  template <typename T>
  static T spelt(const std::string& text)
  {
    using Wide = decltype(T() + T());
    Wide value = 0;
    std::istringstream stream(text);
    return stream >> value ? static_cast<T>(value) : T(0);
  }

  conduit_node* Handle;
  bool Owns;
};

// The node of the C interface; it stays the object's.
inline conduit_node* c_node(const Node* node)
{
  return node ? node->Handle : nullptr;
}

// An object that refers to a node of the C interface, which stays its owner's.
inline Node cpp_node(conduit_node* node)
{
  return Node(node);
}

}

#endif
