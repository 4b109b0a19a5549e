// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { ValueTable } from "../../src/history/table";

describe("the table beside a plot", () => {
  let table: ValueTable;
  const said = (): string[][] => [...table.element.tBodies[0]!.rows].map((row) => [...row.cells].map(({ textContent }) => textContent));
  const row = (name: string, ...cells: string[]) => ({ name, colour: "rgb(1, 2, 3)", cells });

  beforeEach(() => {
    table = new ValueTable(["least", "largest"]);
    document.body.replaceChildren(table.element);
  });

  it("says what it is told, with as many rows as there are", () => {
    table.show([row("now", "1", "2"), row("before", "3", "4")]);
    expect([...table.element.tHead!.rows[0]!.cells].map(({ textContent, scope }) => [textContent, scope])).toEqual([["", ""], ["least", "col"], ["largest", "col"]]);
    expect(said()).toEqual([["now", "1", "2"], ["before", "3", "4"]]);
    table.show([row("now", "5", "2")]);
    expect(said()).toEqual([["now", "5", "2"]]);
    expect([...table.element.tBodies[0]!.rows[0]!.cells].map(({ title }) => title)).toEqual(["now", "", ""]);
    table.show([{ ...row("now", "5", "2"), hint: "2.0001" }]);
    expect(table.element.tBodies[0]!.rows[0]!.cells[2]!.title).toBe("2.0001");
    expect(table.element.querySelector<HTMLElement>(".colour")!.style.background).toBe("rgb(1, 2, 3)");
    expect(table.element.tHead!.hidden).toBe(false);
    table.show([]);
    expect([said(), table.element.tHead!.hidden]).toEqual([[], true]);
  });

  it("keeps what is chosen in it while numbers beside it change", () => {
    table.show([row("now", "1", "2"), row("before", "3", "4")]);
    const [name, least, largest] = table.element.tBodies[0]!.rows[0]!.cells;
    getSelection()!.selectAllChildren(largest!);
    table.show([row("now", "7", "2"), row("before", "3", "4")]);
    expect(getSelection()!.toString()).toBe("2");
    expect([...table.element.tBodies[0]!.rows[0]!.cells]).toEqual([name, least, largest]);
    expect([name!.isConnected, least!.textContent]).toEqual([true, "7"]);
  });
});
