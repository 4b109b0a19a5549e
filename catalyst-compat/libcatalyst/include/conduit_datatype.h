/* Questions about what a node holds: the type of its elements and how they lie in memory. */
#ifndef conduit_datatype_h
#define conduit_datatype_h

#include <stddef.h>
#include <stdlib.h>

#include "conduit_bitwidth_style_types.h"
#include "conduit_endianness_types.h"
#include "conduit_c_exports.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct conduit_datatype_impl conduit_datatype;

/* Bytes of conduit_index_t. */
CONDUIT_C_API int conduit_datatype_sizeof_index_t(void);
/* The number of the type, one of CONDUIT_*_ID. */
CONDUIT_C_API conduit_index_t conduit_datatype_id(const conduit_datatype* datatype);
/* The name of the type; freed by conduit_datatype_name_destroy. */
CONDUIT_C_API char* conduit_datatype_name(const conduit_datatype* datatype);
CONDUIT_C_API void conduit_datatype_name_destroy(char* name);

/* Number of elements; offset, stride and element bytes in bytes; order of bytes, one of CONDUIT_ENDIANNESS_*_ID. */
CONDUIT_C_API conduit_index_t conduit_datatype_number_of_elements(const conduit_datatype* datatype);
CONDUIT_C_API conduit_index_t conduit_datatype_offset(const conduit_datatype* datatype);
CONDUIT_C_API conduit_index_t conduit_datatype_stride(const conduit_datatype* datatype);
CONDUIT_C_API conduit_index_t conduit_datatype_element_bytes(const conduit_datatype* datatype);
CONDUIT_C_API conduit_index_t conduit_datatype_endianness(const conduit_datatype* datatype);
/* From the start of the data to an element, in bytes. */
CONDUIT_C_API conduit_index_t conduit_datatype_element_index(const conduit_datatype* datatype, conduit_index_t index);

/* 1 for yes, 0 for no. */
#define CONDUIT_DATATYPE_IS(what) CONDUIT_C_API int conduit_datatype_##what(const conduit_datatype* datatype)
CONDUIT_DATATYPE_IS(is_empty);
CONDUIT_DATATYPE_IS(is_object);
CONDUIT_DATATYPE_IS(is_list);
CONDUIT_DATATYPE_IS(is_number);
CONDUIT_DATATYPE_IS(is_floating_point);
CONDUIT_DATATYPE_IS(is_integer);
CONDUIT_DATATYPE_IS(is_signed_integer);
CONDUIT_DATATYPE_IS(is_unsigned_integer);
CONDUIT_DATATYPE_IS(is_int8);
CONDUIT_DATATYPE_IS(is_int16);
CONDUIT_DATATYPE_IS(is_int32);
CONDUIT_DATATYPE_IS(is_int64);
CONDUIT_DATATYPE_IS(is_uint8);
CONDUIT_DATATYPE_IS(is_uint16);
CONDUIT_DATATYPE_IS(is_uint32);
CONDUIT_DATATYPE_IS(is_uint64);
CONDUIT_DATATYPE_IS(is_float32);
CONDUIT_DATATYPE_IS(is_float64);
CONDUIT_DATATYPE_IS(is_char);
CONDUIT_DATATYPE_IS(is_short);
CONDUIT_DATATYPE_IS(is_int);
CONDUIT_DATATYPE_IS(is_long);
CONDUIT_DATATYPE_IS(is_unsigned_char);
CONDUIT_DATATYPE_IS(is_unsigned_short);
CONDUIT_DATATYPE_IS(is_unsigned_int);
CONDUIT_DATATYPE_IS(is_unsigned_long);
CONDUIT_DATATYPE_IS(is_float);
CONDUIT_DATATYPE_IS(is_double);
CONDUIT_DATATYPE_IS(is_string);
CONDUIT_DATATYPE_IS(is_char8_str);
CONDUIT_DATATYPE_IS(is_little_endian);
CONDUIT_DATATYPE_IS(is_big_endian);
CONDUIT_DATATYPE_IS(endianness_matches_machine);
#undef CONDUIT_DATATYPE_IS

#ifdef __cplusplus
}
#endif

#endif
