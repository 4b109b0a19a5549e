/* Calls one of VTK's tests of its module CatalystConduit. */
#include <cstring>
int TestConduitSource(int, char*[]);
int TestDataObjectToConduit(int, char*[]);

int main(int count, char* arguments[])
{
  const bool is_source = count > 1 && std::strcmp(arguments[1], "source") == 0;
  return is_source ? TestConduitSource(count, arguments) : TestDataObjectToConduit(count, arguments);
}
