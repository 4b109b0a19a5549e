/* What VTK 9.2 has and 9.1 lacks, so that a module of the later one compiles as it is beside the earlier one. */
#pragma once
#include <set>
#include <vtkSmartPointer.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>

#define VTK_ABI_NAMESPACE_BEGIN
#define VTK_ABI_NAMESPACE_END

struct Distinct
{
};

inline vtkUnsignedCharArray* operator->*(vtkUnsignedCharArray* types, Distinct)
{
  static const auto distinct = vtkSmartPointer<vtkUnsignedCharArray>::New();
  std::set<unsigned char> seen;
  for (vtkIdType cell = 0; cell < types->GetNumberOfTuples(); ++cell)
  {
    seen.insert(types->GetValue(cell));
  }
  distinct->Reset();
  for (const unsigned char type : seen)
  {
    distinct->InsertNextValue(type);
  }
  return distinct;
}
#define GetDistinctCellTypesArray() GetCellTypesArray()->*Distinct()
