// What conduit_cpp::Node has for each type of number. Included by catalyst_conduit.hpp, which undefines it after use.

// The layout of an array, and the same to pass it on.
#define CATALYST_CONDUIT_LAYOUT(type)                                                                        \
  conduit_index_t count = 1, conduit_index_t offset = 0, conduit_index_t stride = sizeof(type),              \
                  conduit_index_t element_bytes = sizeof(type), conduit_index_t endianness = 0
#define CATALYST_CONDUIT_PASS count, offset, stride, element_bytes, endianness

// What has the name of the type in it.
#define CATALYST_CONDUIT_NAMED(stem, type)                                                                   \
  void set_##stem(const type data) { conduit_node_set_##stem(this->Handle, data); }                          \
  void set_path_##stem(const std::string& path, const type data)                                             \
  {                                                                                                          \
    conduit_node_set_path_##stem(this->Handle, path.c_str(), data);                                          \
  }                                                                                                          \
  void set_##stem##_vector(const std::vector<type>& data)                                                    \
  {                                                                                                          \
    conduit_node_set_##stem##_ptr(                                                                           \
      this->Handle, const_cast<type*>(some(data)), static_cast<conduit_index_t>(data.size()));               \
  }                                                                                                          \
  void set_path_##stem##_vector(const std::string& path, const std::vector<type>& data)                      \
  {                                                                                                          \
    conduit_node_set_path_##stem##_ptr(this->Handle, path.c_str(), const_cast<type*>(some(data)),            \
      static_cast<conduit_index_t>(data.size()));                                                            \
  }                                                                                                          \
  void set_external_##stem##_vector(const std::vector<type>& data)                                           \
  {                                                                                                          \
    conduit_node_set_external_##stem##_ptr(                                                                  \
      this->Handle, const_cast<type*>(data.data()), static_cast<conduit_index_t>(data.size()));              \
  }                                                                                                          \
  void set_path_external_##stem##_vector(const std::string& path, const std::vector<type>& data)             \
  {                                                                                                          \
    conduit_node_set_path_external_##stem##_ptr(this->Handle, path.c_str(), const_cast<type*>(data.data()),  \
      static_cast<conduit_index_t>(data.size()));                                                            \
  }                                                                                                          \
  void set_##stem##_ptr(const type* data, CATALYST_CONDUIT_LAYOUT(type))                                     \
  {                                                                                                          \
    conduit_node_set_##stem##_ptr_detailed(this->Handle, const_cast<type*>(data), CATALYST_CONDUIT_PASS);    \
  }                                                                                                          \
  void set_path_##stem##_ptr(const std::string& path, const type* data, CATALYST_CONDUIT_LAYOUT(type))       \
  {                                                                                                          \
    conduit_node_set_path_##stem##_ptr_detailed(                                                             \
      this->Handle, path.c_str(), const_cast<type*>(data), CATALYST_CONDUIT_PASS);                           \
  }                                                                                                          \
  void set_external_##stem##_ptr(const type* data, CATALYST_CONDUIT_LAYOUT(type))                            \
  {                                                                                                          \
    conduit_node_set_external_##stem##_ptr_detailed(                                                         \
      this->Handle, const_cast<type*>(data), CATALYST_CONDUIT_PASS);                                         \
  }                                                                                                          \
  void set_path_external_##stem##_ptr(                                                                       \
    const std::string& path, const type* data, CATALYST_CONDUIT_LAYOUT(type))                                \
  {                                                                                                          \
    conduit_node_set_path_external_##stem##_ptr_detailed(                                                    \
      this->Handle, path.c_str(), const_cast<type*>(data), CATALYST_CONDUIT_PASS);                           \
  }                                                                                                          \
  type as_##stem() const { CATALYST_CONDUIT_WRAP_EXCEP(return conduit_node_as_##stem(this->Handle)) }        \
  type* as_##stem##_ptr()                                                                                    \
  {                                                                                                          \
    CATALYST_CONDUIT_WRAP_EXCEP(return conduit_node_as_##stem##_ptr(this->Handle))                           \
  }                                                                                                          \
  const type* as_##stem##_ptr() const                                                                        \
  {                                                                                                          \
    CATALYST_CONDUIT_WRAP_EXCEP(return conduit_node_as_##stem##_ptr(this->Handle))                           \
  }                                                                                                          \
  type fetch_path_as_##stem(const std::string& path) const                                                   \
  {                                                                                                          \
    CATALYST_CONDUIT_WRAP_EXCEP(return conduit_node_fetch_path_as_##stem(this->Handle, path.c_str()))        \
  }                                                                                                          \
  type to_##stem() const { return this->converted<type>(); }

// What is found by the type alone.
#define CATALYST_CONDUIT_TYPED(stem, type)                                                                   \
  void set(const type data) { this->set_##stem(data); }                                                      \
  void set(const std::vector<type>& data) { this->set_##stem##_vector(data); }                               \
  void set(const type* data, CATALYST_CONDUIT_LAYOUT(type))                                                  \
  {                                                                                                          \
    this->set_##stem##_ptr(data, CATALYST_CONDUIT_PASS);                                                     \
  }                                                                                                          \
  void set_path(const std::string& path, const type data) { this->set_path_##stem(path, data); }             \
  void set_path(const std::string& path, const std::vector<type>& data)                                      \
  {                                                                                                          \
    this->set_path_##stem##_vector(path, data);                                                              \
  }                                                                                                          \
  void set_path(const std::string& path, const type* data, CATALYST_CONDUIT_LAYOUT(type))                    \
  {                                                                                                          \
    this->set_path_##stem##_ptr(path, data, CATALYST_CONDUIT_PASS);                                          \
  }                                                                                                          \
  void set_external(const std::vector<type>& data) { this->set_external_##stem##_vector(data); }             \
  void set_external(const type* data, CATALYST_CONDUIT_LAYOUT(type))                                         \
  {                                                                                                          \
    this->set_external_##stem##_ptr(data, CATALYST_CONDUIT_PASS);                                            \
  }                                                                                                          \
  void set_path_external(const std::string& path, const std::vector<type>& data)                             \
  {                                                                                                          \
    this->set_path_external_##stem##_vector(path, data);                                                     \
  }                                                                                                          \
  void set_path_external(const std::string& path, const type* data, CATALYST_CONDUIT_LAYOUT(type))           \
  {                                                                                                          \
    this->set_path_external_##stem##_ptr(path, data, CATALYST_CONDUIT_PASS);                                 \
  }                                                                                                          \
  Node& operator=(const type data)                                                                           \
  {                                                                                                          \
    this->set(data);                                                                                         \
    return *this;                                                                                            \
  }                                                                                                          \
  Node& operator=(const std::vector<type>& data)                                                             \
  {                                                                                                          \
    this->set(data);                                                                                         \
    return *this;                                                                                            \
  }
