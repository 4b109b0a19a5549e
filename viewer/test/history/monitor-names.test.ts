import { describe, expect, it } from "vitest";
import { monitorText } from "../../src/history/monitor-names";

describe("the name of a monitor in words", () => {
  it("says what is measured and of what", () => {
    const names = ["pressure.l2", "quality.min", "quality.inverted", "wall_shear_stress.max", "inlet.integral.x", "inlet.flow_rate", "u.non_finite", "lift.mean_pressure", "h.bins.3"];
    expect(names.map(monitorText)).toEqual([
      "Pressure, RMS", "Quality, minimum", "Quality, inverted cells", "Wall shear stress, maximum", "Inlet, integral x", "Inlet, flow rate", "u, values that are no number", "Lift, mean pressure", "h, bins 3",
    ]);
  });

  it("is that of the run where it is no path, and where a part is no measure", () => {
    expect(["pressure_drop", "Cd", "p", "", "flow.constructor", "mass."].map(monitorText)).toEqual(["Pressure drop", "Cd", "p", "", "Flow, constructor", "Mass"]);
  });
});
