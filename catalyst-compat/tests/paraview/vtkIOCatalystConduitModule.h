/* As VTK's build writes it for a static library. */
#pragma once
#define VTKIOCATALYSTCONDUIT_EXPORT
#define VTKIOCATALYSTCONDUIT_NO_EXPORT
