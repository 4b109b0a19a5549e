// Conduit's types and layouts as objects. Included by catalyst_conduit.hpp.
#ifndef catalyst_conduit_datatype_hpp
#define catalyst_conduit_datatype_hpp

#include <string>

#include "conduit.h"

namespace conduit_cpp
{

class Node;

// Type and layout of what a node holds; good for as long as the node is there and keeps it.
class DataType
{
public:
  enum class Id
  {
    int8,
    int16,
    int32,
    int64,
    uint8,
    uint16,
    uint32,
    uint64,
    float32,
    float64,
    unknown
  };

  bool is_valid() const { return this->Type != nullptr; }

  Id id() const
  {
    const conduit_index_t number = this->is_valid() ? this->type_id() : conduit_index_t(CONDUIT_EMPTY_ID);
    return number < CONDUIT_INT8_ID || number > CONDUIT_FLOAT64_ID ? Id::unknown
                                                                  : static_cast<Id>(number - CONDUIT_INT8_ID);
  }

  conduit_index_t type_id() const { return conduit_datatype_id(this->Type); }
  std::string name() const
  {
    char* text = conduit_datatype_name(this->Type);
    std::string name(text ? text : "");
    conduit_datatype_name_destroy(text);
    return name;
  }

  conduit_index_t number_of_elements() const { return conduit_datatype_number_of_elements(this->Type); }
  conduit_index_t offset() const { return conduit_datatype_offset(this->Type); }
  conduit_index_t stride() const { return conduit_datatype_stride(this->Type); }
  conduit_index_t element_bytes() const { return conduit_datatype_element_bytes(this->Type); }
  conduit_index_t endianness() const { return conduit_datatype_endianness(this->Type); }
  conduit_index_t element_index(conduit_index_t index) const
  {
    return conduit_datatype_element_index(this->Type, index);
  }

#define CATALYST_CONDUIT_ANSWER(what)                                                                        \
  bool what() const { return conduit_datatype_##what(this->Type) != 0; }
  CATALYST_CONDUIT_ANSWER(is_empty)
  CATALYST_CONDUIT_ANSWER(is_object)
  CATALYST_CONDUIT_ANSWER(is_list)
  CATALYST_CONDUIT_ANSWER(is_number)
  CATALYST_CONDUIT_ANSWER(is_floating_point)
  CATALYST_CONDUIT_ANSWER(is_integer)
  CATALYST_CONDUIT_ANSWER(is_signed_integer)
  CATALYST_CONDUIT_ANSWER(is_unsigned_integer)
  CATALYST_CONDUIT_ANSWER(is_int8)
  CATALYST_CONDUIT_ANSWER(is_int16)
  CATALYST_CONDUIT_ANSWER(is_int32)
  CATALYST_CONDUIT_ANSWER(is_int64)
  CATALYST_CONDUIT_ANSWER(is_uint8)
  CATALYST_CONDUIT_ANSWER(is_uint16)
  CATALYST_CONDUIT_ANSWER(is_uint32)
  CATALYST_CONDUIT_ANSWER(is_uint64)
  CATALYST_CONDUIT_ANSWER(is_float32)
  CATALYST_CONDUIT_ANSWER(is_float64)
  CATALYST_CONDUIT_ANSWER(is_char)
  CATALYST_CONDUIT_ANSWER(is_short)
  CATALYST_CONDUIT_ANSWER(is_int)
  CATALYST_CONDUIT_ANSWER(is_long)
  CATALYST_CONDUIT_ANSWER(is_unsigned_char)
  CATALYST_CONDUIT_ANSWER(is_unsigned_short)
  CATALYST_CONDUIT_ANSWER(is_unsigned_int)
  CATALYST_CONDUIT_ANSWER(is_unsigned_long)
  CATALYST_CONDUIT_ANSWER(is_float)
  CATALYST_CONDUIT_ANSWER(is_double)
  CATALYST_CONDUIT_ANSWER(is_string)
  CATALYST_CONDUIT_ANSWER(is_char8_str)
  CATALYST_CONDUIT_ANSWER(is_little_endian)
  CATALYST_CONDUIT_ANSWER(is_big_endian)
  CATALYST_CONDUIT_ANSWER(endianness_matches_machine)
#undef CATALYST_CONDUIT_ANSWER

private:
  friend class Node;
  explicit DataType(const conduit_datatype* type)
    : Type(type)
  {
  }

  const conduit_datatype* Type;
};

}

#endif
