/* Types by their width, types by their C names, and their numbers. For 64-bit platforms on which int has 32 bits and long 64. */
#ifndef conduit_bitwidth_style_types_h
#define conduit_bitwidth_style_types_h

#include "conduit_config.h"

#define CONDUIT_EMPTY_ID 0
#define CONDUIT_OBJECT_ID 1
#define CONDUIT_LIST_ID 2
#define CONDUIT_INT8_ID 3
#define CONDUIT_INT16_ID 4
#define CONDUIT_INT32_ID 5
#define CONDUIT_INT64_ID 6
#define CONDUIT_UINT8_ID 7
#define CONDUIT_UINT16_ID 8
#define CONDUIT_UINT32_ID 9
#define CONDUIT_UINT64_ID 10
#define CONDUIT_FLOAT32_ID 11
#define CONDUIT_FLOAT64_ID 12
#define CONDUIT_CHAR8_STR_ID 13

#define CONDUIT_EMPTY_T CONDUIT_EMPTY_ID
#define CONDUIT_OBJECT_T CONDUIT_OBJECT_ID
#define CONDUIT_LIST_T CONDUIT_LIST_ID
#define CONDUIT_INT8_T CONDUIT_INT8_ID
#define CONDUIT_INT16_T CONDUIT_INT16_ID
#define CONDUIT_INT32_T CONDUIT_INT32_ID
#define CONDUIT_INT64_T CONDUIT_INT64_ID
#define CONDUIT_UINT8_T CONDUIT_UINT8_ID
#define CONDUIT_UINT16_T CONDUIT_UINT16_ID
#define CONDUIT_UINT32_T CONDUIT_UINT32_ID
#define CONDUIT_UINT64_T CONDUIT_UINT64_ID
#define CONDUIT_FLOAT32_T CONDUIT_FLOAT32_ID
#define CONDUIT_FLOAT64_T CONDUIT_FLOAT64_ID
#define CONDUIT_CHAR8_STR_T CONDUIT_CHAR8_STR_ID

/* Which C types are the types by width. */
#define CONDUIT_INT8_NATIVE_TYPE signed char
#define CONDUIT_INT16_NATIVE_TYPE signed short
#define CONDUIT_INT32_NATIVE_TYPE signed int
#define CONDUIT_INT64_NATIVE_TYPE signed long
#define CONDUIT_UINT8_NATIVE_TYPE unsigned char
#define CONDUIT_UINT16_NATIVE_TYPE unsigned short
#define CONDUIT_UINT32_NATIVE_TYPE unsigned int
#define CONDUIT_UINT64_NATIVE_TYPE unsigned long
#define CONDUIT_FLOAT32_NATIVE_TYPE float
#define CONDUIT_FLOAT64_NATIVE_TYPE double
#define CONDUIT_USE_CHAR
#define CONDUIT_USE_SHORT
#define CONDUIT_USE_INT
#define CONDUIT_USE_LONG
#define CONDUIT_USE_FLOAT
#define CONDUIT_USE_DOUBLE

typedef signed char conduit_int8;
typedef signed short conduit_int16;
typedef signed int conduit_int32;
typedef signed long conduit_int64;
typedef unsigned char conduit_uint8;
typedef unsigned short conduit_uint16;
typedef unsigned int conduit_uint32;
typedef unsigned long conduit_uint64;
typedef float conduit_float32;
typedef double conduit_float64;
typedef conduit_int64 conduit_index_t;
#define CONDUIT_INDEX_T_ID CONDUIT_INT64_ID

typedef char conduit_char;
typedef short conduit_short;
typedef int conduit_int;
typedef long conduit_long;
typedef long long conduit_long_long;
typedef signed char conduit_signed_char;
typedef signed short conduit_signed_short;
typedef signed int conduit_signed_int;
typedef signed long conduit_signed_long;
typedef signed long long conduit_signed_long_long;
typedef unsigned char conduit_unsigned_char;
typedef unsigned short conduit_unsigned_short;
typedef unsigned int conduit_unsigned_int;
typedef unsigned long conduit_unsigned_long;
typedef unsigned long long conduit_unsigned_long_long;
typedef float conduit_float;
typedef double conduit_double;

#define CONDUIT_NATIVE_CHAR char
#define CONDUIT_NATIVE_SHORT short
#define CONDUIT_NATIVE_INT int
#define CONDUIT_NATIVE_LONG long
#define CONDUIT_NATIVE_SIGNED_CHAR signed char
#define CONDUIT_NATIVE_SIGNED_SHORT signed short
#define CONDUIT_NATIVE_SIGNED_INT signed int
#define CONDUIT_NATIVE_SIGNED_LONG signed long
#define CONDUIT_NATIVE_UNSIGNED_CHAR unsigned char
#define CONDUIT_NATIVE_UNSIGNED_SHORT unsigned short
#define CONDUIT_NATIVE_UNSIGNED_INT unsigned int
#define CONDUIT_NATIVE_UNSIGNED_LONG unsigned long
#define CONDUIT_NATIVE_FLOAT float
#define CONDUIT_NATIVE_DOUBLE double

#define CONDUIT_NATIVE_CHAR_ID CONDUIT_INT8_ID
#define CONDUIT_NATIVE_SHORT_ID CONDUIT_INT16_ID
#define CONDUIT_NATIVE_INT_ID CONDUIT_INT32_ID
#define CONDUIT_NATIVE_LONG_ID CONDUIT_INT64_ID
#define CONDUIT_NATIVE_LONG_LONG_ID CONDUIT_INT64_ID
#define CONDUIT_NATIVE_SIGNED_CHAR_ID CONDUIT_INT8_ID
#define CONDUIT_NATIVE_SIGNED_SHORT_ID CONDUIT_INT16_ID
#define CONDUIT_NATIVE_SIGNED_INT_ID CONDUIT_INT32_ID
#define CONDUIT_NATIVE_SIGNED_LONG_ID CONDUIT_INT64_ID
#define CONDUIT_NATIVE_UNSIGNED_CHAR_ID CONDUIT_UINT8_ID
#define CONDUIT_NATIVE_UNSIGNED_SHORT_ID CONDUIT_UINT16_ID
#define CONDUIT_NATIVE_UNSIGNED_INT_ID CONDUIT_UINT32_ID
#define CONDUIT_NATIVE_UNSIGNED_LONG_ID CONDUIT_UINT64_ID
#define CONDUIT_NATIVE_FLOAT_ID CONDUIT_FLOAT32_ID
#define CONDUIT_NATIVE_DOUBLE_ID CONDUIT_FLOAT64_ID

#endif
