/** How the camera follows the mouse and fingers: left turns, middle or shift pans, right or ctrl+shift zooms, the wheel zooms. */
import vtkGestureCameraManipulator from "@kitware/vtk.js/Interaction/Manipulators/GestureCameraManipulator";
import vtkPanManipulator from "@kitware/vtk.js/Interaction/Manipulators/MouseCameraTrackballPanManipulator";
import vtkRotateManipulator from "@kitware/vtk.js/Interaction/Manipulators/MouseCameraTrackballRotateManipulator";
import vtkZoomManipulator from "@kitware/vtk.js/Interaction/Manipulators/MouseCameraTrackballZoomManipulator";
import vtkInteractorStyleManipulator from "@kitware/vtk.js/Interaction/Style/InteractorStyleManipulator";

const LEFT = 1, MIDDLE = 2, RIGHT = 3;

export function mouse(): vtkInteractorStyleManipulator {
  const style = vtkInteractorStyleManipulator.newInstance();
  for (const manipulator of [
    vtkRotateManipulator.newInstance({ button: LEFT }),
    vtkPanManipulator.newInstance({ button: LEFT, shift: true }),
    vtkZoomManipulator.newInstance({ button: LEFT, shift: true, control: true }),
    vtkPanManipulator.newInstance({ button: MIDDLE }),
    vtkZoomManipulator.newInstance({ button: RIGHT }),
    vtkZoomManipulator.newInstance({ dragEnabled: false, scrollEnabled: true }),
  ]) style.addMouseManipulator(manipulator);
  style.addGestureManipulator(vtkGestureCameraManipulator.newInstance());
  return style;
}
